"""What tools/drive.py plays on: a program in a window of its own display, with hands and eyes."""

import json
import os
import re
import shutil
import signal
import statistics
import struct
import subprocess
import time
import zlib


class Failed(Exception):
    """Something that should have happened did not."""


class Stage:
    """A program in a window of its own display."""

    def __init__(self, command, out, size, patience, beside=None, scale=1):
        """`beside` another stage, a second program has a window on the same display, and settings and worlds of its own. `scale` is that
        of the display and of the settings."""
        self.out, self.size, self.patience, self.scale = out, size, patience, scale
        self.shots = []
        self.pointer = None
        self.said, self.frame_count, self.unread = [], 0, b""
        self.log = out / "log.txt"
        self.server = self.program = self.written = self.read = None
        try:
            self.start(command, beside)
        except BaseException:
            self.close()
            raise

    def start(self, command, beside):
        """Starts the display, and the program on it."""
        out = self.out
        out.mkdir(parents=True, exist_ok=True)
        display = beside.env["DISPLAY"][1:] if beside else self.open_display()
        self.screen = beside.screen if beside else out / "Xvfb_screen0"
        self.env = dict(os.environ, DISPLAY=f":{display}", WINIT_UNIX_BACKEND="x11",
                        WINIT_X11_SCALE_FACTOR=str(self.scale))
        self.env.pop("WAYLAND_DISPLAY", None)
        # Settings and worlds of whoever plays here by hand stay as they are.
        for variable, folder in (("XDG_CONFIG_HOME", "config"), ("XDG_DATA_HOME", "data")):
            folder = out.resolve() / folder
            shutil.rmtree(folder, ignore_errors=True)
            self.env[variable] = str(folder)
        self.command = command
        self.prepare()
        self.written, self.read = open(self.log, "wb"), open(self.log, "rb")
        self.started = time.monotonic()
        self.run()

    def prepare(self):
        """Settings with which a renderer in software is as fast as may be, for programs that have settings."""
        file = self.out.resolve() / "config" / "bevy_burrow" / "digger.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        settings = {"quality": "low", "view_distance": 200, "day_minutes": 0, "ui_scale": self.scale}
        file.write_text(json.dumps(settings))

    def run(self):
        """Starts the program, or starts it again: what it says goes on in the same log."""
        self.program = subprocess.Popen(self.command, env=self.env, stdout=self.written, stderr=subprocess.STDOUT)

    def wait_for_end(self):
        """Waits until the program has ended by itself."""
        try:
            status = self.program.wait(self.patience)
        except subprocess.TimeoutExpired:
            raise Failed("the program does not end") from None
        if status != 0:
            raise Failed(f"the program ended with {status}")

    def open_display(self):
        """Starts a display, and returns its number."""
        size = self.size
        read, write = os.pipe()
        # Xvfb itself picks a display that is free, and tells when it is ready.
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size[0]}x{size[1]}x24", "-nolisten", "tcp",
             # Xvfb keeps what it shows in a file there.
             "-fbdir", str(self.out)],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as told:
            display = told.readline().strip()
        if not display:
            raise Failed("Xvfb did not start")
        return display

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
        if self.read:
            self.lines()
        for file in (self.written, self.read):
            if file:
                file.close()

    # What the program says

    def lines(self):
        """All that was said, frames left out."""
        new = b"" if self.read.closed else self.read.read()
        *whole, self.unread = (self.unread + new).split(b"\n")
        for line in whole:
            if line == b"frame":
                self.frame_count += 1
            else:
                self.said.append(line.decode(errors="replace"))
        return self.said

    def frames(self):
        """Frames so far, of a program that tells of each."""
        self.lines()
        return self.frame_count

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
            time.sleep(0.02)
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
            ["xdotool", "search", "--sync", "--all", "--onlyvisible", "--pid", str(self.program.pid), "--name", title],
            env=self.env, check=True, capture_output=True, text=True, timeout=self.patience,
        )
        self.window = found.stdout.split()[0]
        self.xdo("windowraise", self.window)
        self.xdo("windowfocus", self.window)

    def move(self, x, y):
        """Moves the pointer there, unless it is there already."""
        place = round(x), round(y)
        if place != self.pointer:
            self.pointer = place
            self.xdo("mousemove", *place)
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
        """A short click: however slow frames are, the button is seen as pressed in one of them only. What it leads to is for the caller
        to wait for."""
        self.move(x, y)
        self.xdo("click", "--delay", 0, button)

    def drag(self, a, b, steps=6):
        self.move(*a)
        self.press()
        for step in range(1, steps + 1):
            t = step / steps
            self.move(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t)
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

    def pixels(self):
        """What the screen shows: its width, its height, and its rows of red, green and blue."""
        dump = self.screen.read_bytes()
        header = struct.unpack(">25I", dump[:100])
        width, height, stride, start = header[4], header[5], header[12], header[0] + 12 * header[19]
        rows = []
        for y in range(height):
            line = dump[start + y * stride:start + y * stride + 4 * width]
            row = bytearray(3 * width)
            row[0::3], row[1::3], row[2::3] = line[2::4], line[1::4], line[0::4]
            rows.append(bytes(row))
        return width, height, rows

    def shoot(self, name):
        """A picture of the whole screen."""
        path = self.out / f"{name}.png"
        width, height, rows = self.pixels()

        def chunk(kind, data):
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

        data = zlib.compress(b"".join(b"\0" + row for row in rows))
        header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))
        self.shots.append(path)
        print(f"  picture {path}", flush=True)

    def contrast(self, part):
        """The standard deviation of the greens, from 0 to 1, in a part of the screen: left, top, width, height in hundredths."""
        width, height, rows = self.pixels()
        left, top, wide, high = (value * side // 100 for value, side in zip(part, (width, height) * 2))
        greens = [green for row in rows[top:top + high] for green in row[3 * left + 1:3 * (left + wide):3]]
        return statistics.pstdev(greens) / 255

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
        print(f"  {self.since_start():5.0f} s, {self.frames():4} frames: {text}", flush=True)
