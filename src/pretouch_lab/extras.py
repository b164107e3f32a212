"""What the lab needs only where it is wanted."""

from pretouch.extras import Extra

SWEEP = Extra("sweep", ("SALib", "distributed", "pyarrow"), "setup", "pretouch-lab")
