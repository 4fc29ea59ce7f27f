# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that `quell denoise` writes to standard error where there is no terminal."""
import re
from dataclasses import dataclass, field

# [ 25%] frame 1 of 4 (1001), 6.41 frames a second, 3 s left
_FRAME = re.compile(r"^\[\s*\d+%\] frame (\d+) of (\d+)(?: \((-?\d+)\))?(?:,.*?, (\d+) s left)?")
# Lines that are kept of a run: enough to find out what happened, however long it was.
_KEPT = 400


@dataclass
class Progress:
    """What a run said so far."""

    done: int = 0
    total: int = 0
    seconds_left: int = -1
    warnings: list = field(default_factory=list)
    errors: list = field(default_factory=list)
    lines: list = field(default_factory=list)

    @property
    def fraction(self):
        return self.done / self.total if self.total else 0.0

    def read(self, line):
        """Takes in one line."""
        line = line.rstrip()
        if not line:
            return
        match = _FRAME.match(line)
        if match:
            self.done, self.total = int(match[1]), int(match[2])
            self.seconds_left = int(match[4]) if match[4] else -1
            return
        self.lines = (self.lines + [line])[-_KEPT:]
        kind, _, text = line.partition(": ")
        if kind == "warning":
            self.warnings = (self.warnings + [text])[-_KEPT:]
        elif kind in ("error", "interrupted"):
            self.errors = (self.errors + [text])[-_KEPT:]

    def text(self):
        """For a bar: `frame 12 of 27, 40 s left`."""
        if not self.total:
            return "starting"
        left = f", {self.seconds_left} s left" if self.seconds_left >= 0 and self.done < self.total else ""
        return f"frame {self.done} of {self.total}{left}"
