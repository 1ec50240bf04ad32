#!/usr/bin/env python3
"""Plays an example by real input: a window under Xvfb, the mouse and keys by xdotool, screenshots in between.

    python3 tools/drive.py sculpt --binary target/release/examples/sculpt --out out/drive
    python3 tools/drive.py --list

Each step is checked by what the program writes to standard output. The exit status is 0 when all of it happened, 1 when
something did not, and 77 when Xvfb or xdotool are missing: a loud skip, which callers may take for either.

An example is a function that is marked with @play and gets a Stage.
"""

import argparse
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

SKIPPED = 77
PLAYS = {}


def play(function):
    """Enters a play under the name of its function."""
    PLAYS[function.__name__] = function
    return function


class Failed(Exception):
    """Something that should have happened did not."""


class Stage:
    """A program in a window of its own display."""

    def __init__(self, command, out, size, patience):
        self.out, self.size, self.patience = out, size, patience
        self.shots = []
        out.mkdir(parents=True, exist_ok=True)
        self.log = out / "log.txt"
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
        self.written = open(self.log, "wb")
        self.program = subprocess.Popen(command, env=self.env, stdout=self.written, stderr=subprocess.STDOUT)

    def close(self):
        """Ends the program and the display."""
        for process in (self.program, self.server):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
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

    def settle(self, quiet=2.0):
        """Waits until the program has had nothing to say for a while."""
        deadline = time.monotonic() + self.patience
        while time.monotonic() < deadline:
            before = self.mark()
            time.sleep(quiet)
            if self.mark() == before:
                return
        raise Failed("the program does not come to rest")

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

    def say(self, text):
        print(f"  {text}", flush=True)


@play
def digger(stage):
    """Starts from the title, digs, changes the radius, digs, takes it back, throws a bomb, pauses, begins a new game."""

    def page(name, since):
        stage.wait(r"^page " + name, since)
        stage.rest()

    def blow(since):
        return int(stage.wait(r"^edit tag=\d+ removed=([1-9]\d*)", since).group(1))

    def look(by):
        for _ in range(3):
            stage.xdo("mousemove_relative", "--", "0", str(by))
            stage.rest()

    radius = lambda: float(stage.last(r"^tool pickaxe radius=([\d.]+)").group(1))
    stage.wait(r"^ready")
    stage.focus("Digger")
    stage.rest()
    stage.shoot("1_title")
    for downs, name in ((1, "Settings"), (2, "Controls"), (3, "Help")):
        since = stage.mark()
        for _ in range(downs):
            stage.key("Down")
        stage.key("Return")
        page(f"Title {name}", since)
        stage.shoot(f"2_{name.lower()}")
        since = stage.mark()
        stage.key("Escape")
        page("Title Menu", since)
    since = stage.mark()
    stage.key("Return")
    page("Playing None", since)
    stage.say("the title's menu starts the game")
    stage.shoot("3_play")

    look(110)
    since = stage.mark()
    stage.press()
    stage.say(f"a blow of the pickaxe dug {blow(since)} voxels")
    stage.release()
    stage.settle(1.0)
    stage.shoot("4_dug")

    before = radius()
    for _ in range(4):
        stage.xdo("click", "--delay", 0, 4)
        stage.rest()
    if not radius() > before:
        raise Failed(f"the wheel left the radius at {radius()}")
    stage.say(f"the wheel changed the radius from {before} to {radius()}")
    since = stage.mark()
    stage.press()
    stage.say(f"the next blow dug {blow(since)} voxels")
    stage.release()
    stage.settle(1.0)
    stage.shoot("5_larger")

    since = stage.mark()
    stage.key("z")
    back = int(stage.wait(r"^history Undo removed=0 added=(\d+)", since).group(1))
    stage.say(f"Z brought {back} voxels back")
    stage.settle(1.0)
    stage.shoot("6_undone")

    since = stage.mark()
    stage.key("6")
    stage.wait(r"^tool bomb", since)
    look(-130)
    since = stage.mark()
    stage.press()
    stage.release()
    stage.say(f"a bomb dug {blow(since)} voxels")
    stage.settle(2.0)
    stage.shoot("7_crater")
    stage.key("F1")
    stage.rest()
    stage.shoot("8_panel")
    stage.key("F1")
    stage.rest()
    since = stage.mark()
    stage.key("Escape")
    page("Paused Menu", since)
    stage.shoot("9_pause")

    for _ in range(4):
        stage.key("Down")
    since = stage.mark()
    stage.key("Return")
    page("Title Menu", since)
    stage.shoot("10_title")
    # The first item is lit: "Go on".
    stage.key("Down")
    since = stage.mark()
    stage.key("Return")
    stage.wait(r"^ready", since)
    page("Playing None", since)
    stage.settle(2.0)
    since = stage.mark()
    stage.key("z")
    stage.wait(r"^history there is nothing to undo", since)
    stage.say("a new game begins on land that nobody has dug")
    stage.shoot("11_new_game")


@play
def sculpt(stage):
    """Digs, drags the radius, digs again, does not dig through the panel, takes both strokes back."""
    stage.focus("sculpt")
    pristine = stage.wait(r"^ready hash=(\w+)").group(1)
    stage.wait(r'^place "Radius"')
    stage.wait(r"^dressed")
    stage.rest()
    stage.shoot("1_start")
    middle = (stage.size[0] / 2, stage.size[1] * 0.6)

    since = stage.mark()
    stage.click(*middle)
    removed = int(stage.wait(r"^stroke tag=\d+ removed=(\d+)", since).group(1))
    if removed == 0:
        raise Failed("a click on the ground dug nothing")
    stage.say(f"a click dug {removed} voxels")
    stage.settle()
    stage.shoot("2_dug")

    radius = lambda: float(stage.last(r"^tool .*radius=([\d.]+)").group(1))
    before, strokes = radius(), stage.last(r"^stroke tag=(\d+)").group(1)
    left, top, right, bottom = stage.place("Radius")
    since, y = stage.mark(), (top + bottom) / 2
    stage.drag((left + (right - left) * 0.45, y), (left + (right - left) * 0.72, y))
    stage.wait(r"^tool ", since)
    if not radius() > before:
        raise Failed(f"the slider left the radius at {radius()}")
    stage.say(f"the slider changed the radius from {before} to {radius()}")
    stage.click(left, top - 8)
    stage.settle()
    if stage.last(r"^stroke tag=(\d+)").group(1) != strokes:
        raise Failed("a click on the panel dug into the ground behind it")
    stage.say("clicks on the panel did not dig")
    stage.shoot("3_radius")

    since = stage.mark()
    stage.click(middle[0] + 60, middle[1])
    more = int(stage.wait(r"^stroke tag=\d+ removed=(\d+)", since).group(1))
    if more <= removed:
        raise Failed(f"the larger brush dug {more} voxels and the smaller one {removed}")
    stage.say(f"the larger brush dug {more} voxels")
    stage.settle()
    stage.shoot("4_larger")
    undo(stage, pristine)


def undo(stage, pristine):
    """Takes back every stroke, by button and by key, and the first of them comes back."""
    hashes = [line.split("hash=")[1] for line in stage.lines() if line.startswith("stroke ") and "hash=" in line]
    since = stage.mark()
    stage.click(*stage.middle("Undo"))
    stage.wait(r"^undo .*hash=" + (hashes[-2] if len(hashes) > 1 else pristine), since)
    stage.say("the button took back a stroke")
    since = stage.mark()
    for _ in range(len(hashes) - 1):
        stage.chord("ctrl", "z")
    stage.wait(r"^undo .*hash=" + pristine, since)
    stage.say(f"Ctrl+Z took back the others: the ground's hash is {pristine} again")
    stage.move(stage.size[0] / 2, stage.size[1] * 0.45)
    stage.shoot("5_undone")
    since = stage.mark()
    stage.chord("ctrl", "y")
    stage.wait(r"^redo .*hash=" + hashes[0], since)
    stage.say("Ctrl+Y brought the first stroke back")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("play", nargs="?", choices=sorted(PLAYS), help="what to play")
    parser.add_argument("--list", action="store_true", help="list the plays")
    parser.add_argument("--binary", type=pathlib.Path, help="the example's program")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/drive"), help="folder for pictures and log")
    parser.add_argument("--size", default="1280x720", help="of the window, in pixels")
    parser.add_argument("--patience", type=float, default=300, help="seconds to wait for each thing")
    parser.add_argument("arguments", nargs="*", help="for the program, after --")
    args = parser.parse_args()
    if args.list:
        for name, function in sorted(PLAYS.items()):
            print(f"{name:10} {function.__doc__}")
        return 0
    if args.play is None:
        parser.error("what is to be played?")
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    if missing:
        print(f"SKIPPED: nothing was driven, as {' and '.join(missing)} is not installed", file=sys.stderr)
        return SKIPPED
    size = tuple(map(int, args.size.split("x")))
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    binary = args.binary or target / "release" / "examples" / args.play
    if not binary.exists():
        print(f"{binary} is not there: build it first, or name it with --binary", file=sys.stderr)
        return 1
    command = [str(binary), "--width", str(size[0]), "--height", str(size[1]), "--out", str(args.out), "--tell"]
    print(f"{args.play}: {binary}", flush=True)
    stage = Stage(command + args.arguments, args.out, size, args.patience)
    try:
        PLAYS[args.play](stage)
    except (Failed, subprocess.SubprocessError) as error:
        print(f"FAILED: {error}; the log is {stage.log}", file=sys.stderr)
        try:
            stage.shoot("failed")
        except subprocess.SubprocessError:
            pass
        return 1
    finally:
        stage.close()
    print(f"{args.play}: all of it happened, {len(stage.shots)} pictures in {args.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
