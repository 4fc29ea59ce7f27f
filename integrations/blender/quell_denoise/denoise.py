# SPDX-License-Identifier: GPL-3.0-or-later
"""`quell denoise` as a process beside Blender: started, asked how far it is, cancelled."""
import os
import queue
import signal
import subprocess
import sys
import threading
import time

from . import binary, frames
from .errors import Problem
from .progress import Progress

# How long a cancelled run may take to finish the file that it is writing.
PATIENCE_SECONDS = 10.0


def command(program, found, numbers, resume=False, further=()):
    """The command line, to be run in the render's folder."""
    line = [program, "denoise", "-o", frames.RESULT_FOLDER]
    if resume:
        line.append("--resume")
    return [*line, *further, *frames.inputs(found, numbers)]


class Run:
    """One run. `step` is called until it returns False; then `outcome` and `message` hold."""

    def __init__(self, line, folder):
        self.line = line
        self.folder = folder
        self.progress = Progress()
        # "", or how it ended: DONE, PARTIAL (some frames failed), FAILED, CANCELLED
        self.outcome = ""
        self.message = ""
        self._process = None
        self._cancelled_at = None
        self._said = queue.SimpleQueue()
        self._threads = []

    def start(self):
        try:
            self._process = subprocess.Popen(
                self.line,
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "NO_COLOR": "1"},
                creationflags=binary.NO_WINDOW,
            )
        except OSError as error:
            raise Problem(f"{self.line[0]} does not start: {error}") from error
        # Pipes cannot be read without waiting on every system, so threads wait.
        for pipe in (self._process.stdout, self._process.stderr):
            thread = threading.Thread(target=self._listen, args=(pipe,), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _listen(self, pipe):
        for line in pipe:
            self._said.put(line.decode("utf-8", "replace"))
        pipe.close()

    def step(self):
        """Takes in what was said since; False once the run has ended. Never waits."""
        if self.outcome:
            return False
        ended = self._process.poll() is not None and not any(thread.is_alive() for thread in self._threads)
        while not self._said.empty():
            self.progress.read(self._said.get())
        if ended:
            self._end(self._process.returncode)
        elif self._cancelled_at is not None and time.monotonic() - self._cancelled_at > PATIENCE_SECONDS:
            self._process.kill()
        return not self.outcome

    def cancel(self):
        """Asks it to stop: it finishes no further frame and leaves only whole files."""
        if self.outcome or self._process is None or self._cancelled_at is not None:
            return
        self._cancelled_at = time.monotonic()
        # Windows passes no Ctrl-C to a process without a console. Files are written beside and renamed, so a kill
        # leaves no half file under a frame's name there either.
        stop = self._process.terminate if sys.platform == "win32" else lambda: self._process.send_signal(signal.SIGINT)
        try:
            stop()
        except OSError:
            pass  # It has just ended.

    def stop_now(self):
        """For the end of Blender: no waiting."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()

    def _end(self, status):
        progress = self.progress
        last = progress.errors[-1] if progress.errors else progress.lines[-1] if progress.lines else f"exit status {status}"
        if status == 0:
            # Cancelled too late is done.
            self.outcome, self.message = "DONE", progress.lines[-1] if progress.lines else "done"
        elif self._cancelled_at is not None:
            self.outcome = "CANCELLED"
            self.message = f"Cancelled: {progress.done} clean frames are written, and whole"
        elif status == 3:
            self.outcome, self.message = "PARTIAL", f"Some frames failed, the others are written. {last}"
        else:
            self.outcome, self.message = "FAILED", last
