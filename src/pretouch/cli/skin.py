"""What `pretouch skin` does: each command by its own file."""

from pretouch.cli.calibrate.options import Calibrate
from pretouch.cli.skin_commands import Keys, Monitor, Provision, Simulate, SkinCommand
from pretouch.cli.skin_coverage_options import Coverage


def skin(command: SkinCommand) -> int:
    """Run one of the commands for sensor units, and return the exit code."""
    match command:
        case Monitor():
            from pretouch.cli.skin_monitor import monitor

            return monitor(command)
        case Calibrate():
            from pretouch.cli.calibrate.command import calibrate_skin

            return calibrate_skin(command)
        case Coverage():
            from pretouch.cli.skin_coverage import skin_coverage

            skin_coverage(command)
        case Simulate():
            from pretouch.cli.skin_simulate import simulate_units

            simulate_units(command)
        case Provision():
            from pretouch.cli.skin_provision import provision_unit

            provision_unit(command)
        case Keys():
            from pretouch.cli.skin_keys import keys_file, list_keys

            list_keys(keys_file(command.keys), command.new)
    return 0
