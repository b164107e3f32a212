"""The soak moves a served Franka through the vendor's library."""

from tests.needs import modules_with

from pretouch.extras import FRANKA

pytest_pycollect_makemodule = modules_with(FRANKA)
