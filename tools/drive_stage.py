"""What tools/drive.py plays on: a program in a window of its own display, with hands and eyes."""

import os
import re
import shutil
import signal
import subprocess
import time


class Failed(Exception):
    """Something that should have happened did not."""


class Stage:
    """A program in a window of its own display."""

    def __init__(self, command, out, size, patience):
        self.out, self.size, self.patience = out, size, patience
        self.shots = []
        self.log = out / "log.txt"
        self.server = self.program = self.written = None
        try:
            self.start(command)
        except BaseException:
            self.close()
            raise

    def start(self, command):
        """Starts the display, and the program on it."""
        out, size = self.out, self.size
        out.mkdir(parents=True, exist_ok=True)
        read, write = os.pipe()
        # Xvfb itself picks a display that is free, and tells when it is ready.
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size[0]}x{size[1]}x24", "-nolisten", "tcp"],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as told:
            display = told.readline().strip()
        if not display:
            raise Failed("Xvfb did not start")
        self.env = dict(os.environ, DISPLAY=f":{display}", WINIT_UNIX_BACKEND="x11", WINIT_X11_SCALE_FACTOR="1")
        self.env.pop("WAYLAND_DISPLAY", None)
        # The settings of whoever plays here by hand stay as they are.
        config = out.resolve() / "config"
        shutil.rmtree(config, ignore_errors=True)
        self.env["XDG_CONFIG_HOME"] = str(config)
        self.written = open(self.log, "wb")
        self.started = time.monotonic()
        self.program = subprocess.Popen(command, env=self.env, stdout=self.written, stderr=subprocess.STDOUT)

    def close(self):
        """Ends the program and the display, as far as they were started."""
        for process in (self.program, self.server):
            if process and process.poll() is None:
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        if self.written:
            self.written.close()

    # What the program says

    def lines(self):
        """All that was said, frames left out."""
        return [line for line in self.log.read_text(errors="replace").splitlines() if line != "frame"]

    def frames(self):
        """Frames so far, of a program that tells of each."""
        return self.log.read_text(errors="replace").splitlines().count("frame")

    def mark(self):
        """The end of what was said so far."""
        return len(self.lines())

    def wait(self, pattern, since=0, patience=None):
        """Waits for a line that matches, and returns the match."""
        deadline = time.monotonic() + (patience or self.patience)
        while time.monotonic() < deadline:
            for line in self.lines()[since:]:
                if found := re.search(pattern, line):
                    return found
            if self.program.poll() is not None:
                raise Failed(f"the program ended with {self.program.returncode}, before it said {pattern!r}")
            time.sleep(0.1)
        raise Failed(f"the program did not say {pattern!r}")

    def last(self, pattern):
        """The last line so far that matches."""
        for line in reversed(self.lines()):
            if found := re.search(pattern, line):
                return found
        raise Failed(f"the program did not say {pattern!r} so far")

    # Hands

    def xdo(self, *args):
        subprocess.run(["xdotool", *map(str, args)], env=self.env, check=True, stdout=subprocess.DEVNULL)

    def focus(self, title):
        """Gives the window the keyboard: there is no window manager to do so."""
        found = subprocess.run(
            ["xdotool", "search", "--sync", "--onlyvisible", "--name", title],
            env=self.env, check=True, capture_output=True, text=True, timeout=self.patience,
        )
        self.window = found.stdout.split()[0]
        self.xdo("windowfocus", self.window)

    def move(self, x, y):
        self.xdo("mousemove", round(x), round(y))
        self.rest()

    def rest(self, seconds=0.6):
        """Two frames' time: in software a frame may take a second. Where the program does not tell, some time."""
        start = self.frames()
        if start == 0:
            time.sleep(seconds)
            return
        deadline = time.monotonic() + self.patience
        while self.frames() < start + 2:
            if time.monotonic() > deadline or self.program.poll() is not None:
                raise Failed("the program draws no more frames")
            time.sleep(0.02)

    def press(self, button=1):
        self.xdo("mousedown", button)
        self.rest()

    def release(self, button=1):
        self.xdo("mouseup", button)
        self.rest()

    def click(self, x, y, button=1):
        """A short click: however slow frames are, the button is seen as pressed in one of them only."""
        self.move(x, y)
        self.xdo("click", "--delay", 0, button)
        self.rest()

    def drag(self, a, b, steps=6):
        self.move(*a)
        self.press()
        for step in range(1, steps + 1):
            t = step / steps
            self.xdo("mousemove", round(a[0] + (b[0] - a[0]) * t), round(a[1] + (b[1] - a[1]) * t))
            self.rest()
        self.release()

    def key(self, name):
        self.xdo("keydown", name)
        self.rest()
        self.xdo("keyup", name)
        self.rest()

    def chord(self, modifier, name):
        self.xdo("keydown", modifier)
        self.rest()
        self.key(name)
        self.xdo("keyup", modifier)
        self.rest()

    # Eyes

    def shoot(self, name):
        """A picture of the whole screen."""
        path = self.out / f"{name}.png"
        if shutil.which("import"):
            subprocess.run(["import", "-window", "root", str(path)], env=self.env, check=True)
        else:
            path = path.with_suffix(".xwd")
            with open(path, "wb") as file:
                subprocess.run(["xwd", "-root", "-silent"], env=self.env, check=True, stdout=file)
        self.shots.append(path)
        print(f"  picture {path}")

    def place(self, name):
        """Left, top, right, bottom of a widget of the panel, as the program told last."""
        found = self.last(rf'^place "{re.escape(name)}" (-?\d+) (-?\d+) (-?\d+) (-?\d+)$')
        return tuple(map(int, found.groups()))

    def middle(self, name):
        left, top, right, bottom = self.place(name)
        return (left + right) / 2, (top + bottom) / 2

    def since_start(self):
        """Seconds since the program was started."""
        return time.monotonic() - self.started

    def say(self, text):
        print(f"  {text}", flush=True)
