from tests.needs import modules_with

from pretouch_lab.learning import LEARN

pytest_pycollect_makemodule = modules_with(LEARN)
