from pretouch_lab.learning import LEARN
from tests.needs import modules_with

pytest_pycollect_makemodule = modules_with(LEARN)
