from pretouch.extras import FRANKA
from tests.needs import modules_with

pytest_pycollect_makemodule = modules_with(FRANKA)
