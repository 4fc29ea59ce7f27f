# SPDX-License-Identifier: GPL-3.0-or-later
"""Render, then denoise, a step at a time: a window's timer drives it, and so does the loop of a script."""
import time

from . import binary, denoise, frames
from .errors import Problem


class Job:
    """`start`, then `step` until it returns False; `outcome` and `message` hold then.

    `render`, where there is one, has `start()`, `step()` (False once it has ended), `cancel()` and `cancelled`.
    """

    def __init__(self, found, program, render=None, resume=False, further=()):
        self.found = found
        self.outcome = ""
        self.message = ""
        self.notes = []
        self._program = program
        self._render = render
        self._rendering = False
        self._resume = resume
        self._further = tuple(further)
        self._run = None
        self._cancelled = False

    def start(self):
        """Whatever can be known to fail is found here, before anything is rendered."""
        if self._render is None and not self.found.existing():
            raise Problem(f"No rendered frame lies in {self.found.folder} ({self.found.names[0]} ...): render first")
        frames.check_writable(self.found.folder)
        frames.check_writable(self.found.result)
        binary.version(self._program)
        if self._render is None:
            self._denoise()
        else:
            self._rendering = True
            self._render.start()

    def step(self):
        """False once all has ended. Never waits."""
        if self.outcome:
            return False
        if self._rendering:
            if self._render.step():
                return True
            self._rendering = False
            if self._render.cancelled or self._cancelled:
                there = len(self.found.existing())
                self._end("CANCELLED", f"Rendering was cancelled. {there} frames are there: Denoise Existing takes them")
                return False
            try:
                self._denoise()
            except Problem as problem:
                self._end("FAILED", str(problem))
                return False
            return True
        if self._run.step():
            return True
        self.notes += [f"quell: {text}" for text in self._run.progress.warnings]
        # The program, run in the render's folder, names the result's without its place.
        self._end(self._run.outcome, self._run.message.replace(f" to {frames.RESULT_FOLDER}", f" to {self.found.result}"))
        return False

    def cancel(self):
        self._cancelled = True
        if self._rendering:
            self._render.cancel()
        elif self._run is not None:
            self._run.cancel()

    def stop_now(self):
        """For the end of Blender."""
        if self._run is not None:
            self._run.stop_now()

    def finish(self, pause=0.05):
        """Steps to the end, for scripts."""
        while self.step():
            time.sleep(pause)

    @property
    def rendering(self):
        return self._rendering

    @property
    def cancelling(self):
        return self._cancelled and not self.outcome

    @property
    def fraction(self):
        return self._run.progress.fraction if self._run is not None else 0.0

    @property
    def lines(self):
        """What the program said, but its progress."""
        return self._run.progress.lines if self._run is not None else []

    def text(self):
        if self.outcome:
            return self.message
        if self._rendering:
            return "Stops after the render (Esc in its window ends it)" if self._cancelled else "Rendering"
        return f"{'Stopping' if self._cancelled else 'Denoising'}: {self._run.progress.text()}"

    def _denoise(self):
        there = self.found.existing()
        if not there:
            raise Problem(f"The render wrote no frame to {self.found.folder}")
        missing = sorted(set(self.found.numbers) - set(there))
        if missing:
            self.notes.append(f"Not rendered, so left out: frames {frames.ranges(missing)}")
        self._run = denoise.Run(
            denoise.command(self._program, self.found, there, self._resume, self._further), self.found.folder
        )
        self._run.start()

    def _end(self, outcome, message):
        self.outcome, self.message = outcome, message
