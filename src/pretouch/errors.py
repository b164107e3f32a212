"""Exceptions for foreseeable misuse. Each message names what was wrong, the value, and the way out.

A control step raises none of these: what can go wrong while the arm moves is a HOLD with a reason (`pretouch.modes`).
"""


class PretouchError(Exception):
    """Base of every error this package raises on purpose."""


class ParameterError(PretouchError, ValueError):
    """A parameter is outside its allowed range."""


class MissingExtraError(PretouchError, ImportError):
    """A command needs an extra that is not installed."""


class RobotModelError(PretouchError, ValueError):
    """A robot model cannot be used as it is, or a link or joint is unknown to it."""


class RobotStateError(PretouchError, ValueError):
    """The controller cannot start from what the robot reports."""


class SkinError(PretouchError, ValueError):
    """A skin, or the file that describes it, is not usable."""


class FixtureError(PretouchError, ValueError):
    """A fixture around the arm is not well defined."""


class PathError(PretouchError, ValueError):
    """A path to follow is not well defined."""


class ExperimentError(PretouchError, ValueError):
    """An experiment cannot be run with these options."""


class SourceError(PretouchError, LookupError):
    """Source text on which stored results depend cannot be found."""


class RecordingError(PretouchError, ValueError):
    """A recording cannot be written, opened or used as requested."""


class HardwareError(PretouchError, RuntimeError):
    """Sensor units, their keys, or their network cannot be used as requested."""


class RobotError(PretouchError, RuntimeError):
    """A real arm, or the connection to it, cannot be used as requested."""


class CalibrationError(PretouchError, ValueError):
    """A calibration, or the motion for it, is not possible as requested."""


class ViewerError(PretouchError, RuntimeError):
    """The page cannot be shown."""


class PluginError(PretouchError, RuntimeError):
    """A part that another distribution adds is missing, or cannot be loaded."""
