"""Install with pip into this Python's environment, and say on one line what is being done.

    python tools/install.py -c constraints.txt -e .

It runs before anything is installed. What pip said is shown whole where it failed.
"""

import subprocess
import sys

_PIP = ["-m", "pip", "install", "--no-compile", "--disable-pip-version-check", "--progress-bar", "off"]
_WIDTH = 78


def install(arguments: list[str]) -> int:
    """Run pip with some arguments, and return its exit code."""
    lines, number = list[str](), 0
    command = [sys.executable, *_PIP, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as pip:
        for line in pip.stdout or ():
            lines.append(line)
            words = line.split()
            if words[:1] in (["Collecting"], ["Downloading"], ["Installing"]):
                number += words[0] == "Collecting"
                show(f"Installing, package {number}: {' '.join(words)}")
    show("Installed.\n" if pip.returncode == 0 else "".join(lines))
    return pip.returncode


def show(text: str) -> None:
    """Write over the line; without a terminal, only what ends it."""
    if sys.stdout.isatty():
        text = text if text.endswith("\n") else text[:_WIDTH]
        print(f"\r\x1b[K{text}", end="", flush=True)
    elif text.endswith("\n"):
        print(text, end="", flush=True)


if __name__ == "__main__":
    sys.exit(install(sys.argv[1:]))
