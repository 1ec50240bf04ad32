#!/usr/bin/env python3
"""Plays an example by real input: a window under Xvfb, the mouse and keys by xdotool, screenshots in between.

    python3 tools/drive.py sculpt --binary target/release/examples/sculpt --out out/drive
    python3 tools/drive.py --list

Each step is checked by what the program writes to standard output. The exit status is 0 when all of it happened, 1 when
something did not, and 77 when Xvfb or xdotool are missing: a loud skip, which callers may take for either.

An example is a function that is marked with @play and gets a Stage. Nothing in it waits for a time: it waits for what
the program says, and for frames.
"""

import argparse
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

from drive_stage import Failed, Stage

SKIPPED = 77
PLAYS = {}


def play(size):
    """Enters a play under the name of its function, with the size of its window: as small as its widgets allow."""

    def enter(function):
        PLAYS[function.__name__] = (function, size)
        return function

    return enter


def told(stage):
    """What the program has said, without what it says whenever somebody turns his head."""
    return [line for line in stage.lines() if not line.startswith("aim ")]


def picture(stage, name, see=None):
    """Shoots when what was said last is on the screen: no pipeline waits, and four frames have passed in silence.

    A frame is told when the program is done with it; it is drawn while the next one is made, and shown after that.
    With `see`, left, top, width and height in hundredths of the window, that part must not be of one colour.
    """
    deadline = time.monotonic() + stage.patience
    while True:
        before = len(told(stage))
        stage.rest()
        stage.rest()
        if len(told(stage)) == before and stage.last(r"^pipelines (\d+)").group(1) == "0":
            break
        if time.monotonic() > deadline:
            raise Failed(f"the program does not come to rest for {name}")
    stage.shoot(name)
    if see and contrast(stage.shots[-1], stage.size, see) < 0.01:
        raise Failed(f"nothing is to be seen in {stage.shots[-1]}")


def contrast(path, size, part):
    """The standard deviation of a picture's greys, from 0 to 1; 1 where ImageMagick is not there to tell."""
    if not shutil.which("convert"):
        return 1.0
    left, top, width, height = (hundredths * size[i % 2] // 100 for i, hundredths in enumerate(part))
    command = ["convert", path, "-crop", f"{width}x{height}+{left}+{top}", "-colorspace", "Gray"]
    command += ["-format", "%[fx:standard_deviation]", "info:"]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def tap(stage, key):
    """A key, pressed and let go within a frame or two."""
    stage.xdo("key", "--delay", 0, key)
    stage.rest()


@play("640x360")
def digger(stage):
    """Starts from the title, digs, changes the radius, digs, takes it back, throws a bomb, pauses, begins a new game."""
    ground = (30, 25, 30, 30)
    blows = r"^edit tag=\d+ removed=([1-9]\d*)"

    def page(name, since):
        stage.wait(r"^page " + name, since)

    def turn(right, down):
        stage.xdo("mousemove_relative", "--", right, down)
        stage.rest()

    def aim():
        return float(stage.last(r"^aim ([\d.]+|none)").group(1).replace("none", "inf"))

    def look_down(to):
        """Until what is aimed at is no farther away: the ground before the feet, but not that below them."""
        for _ in range(40):
            if aim() <= to:
                return
            turn(0, 20)
        raise Failed(f"the ground is {aim()} m away, however far one looks down")

    def dig():
        """Swings until the ground breaks. On a slow machine the hand swings more than once: what each blow took."""
        since = stage.mark()
        stage.xdo("mousedown", 1)
        stage.wait(blows, since)
        stage.xdo("mouseup", 1)
        rested = stage.mark()
        while True:
            stage.rest()
            stage.rest()
            if not any(re.search(blows, line) for line in stage.lines()[rested:]):
                break
            rested = stage.mark()
        return [int(found.group(1)) for line in stage.lines()[since:] if (found := re.search(blows, line))]

    radius = lambda: float(stage.last(r"^tool pickaxe radius=([\d.]+)").group(1))
    stage.wait(r"^ready")
    stage.wait(r"^painted")
    stage.say(f"the land is there and painted {stage.since_start():.1f} s after the start")
    stage.focus("Digger")
    picture(stage, "1_title", see=(60, 50, 35, 40))
    for downs, name in ((1, "Settings"), (2, "Controls"), (3, "Help")):
        since = stage.mark()
        for _ in range(downs):
            tap(stage, "Down")
        tap(stage, "Return")
        page(f"Title {name}", since)
        picture(stage, f"2_{name.lower()}")
        since = stage.mark()
        tap(stage, "Escape")
        page("Title Menu", since)
        stage.rest()
    began = stage.mark()
    tap(stage, "Return")
    page("Playing None", began)
    stage.say("the title's menu starts the game")
    stage.rest()
    turn(0, 60)
    # As far ahead that no hole reaches the feet: what is dug here comes back beside the player, not around him.
    look_down(5.4)
    picture(stage, "3_play", see=ground)

    taken = dig()
    stage.say(f"blows of the pickaxe dug {taken} voxels")
    picture(stage, "4_dug", see=ground)

    turn(230, 0)
    look_down(5.4)
    before = radius()
    for _ in range(4):
        stage.xdo("click", "--delay", 0, 4)
        stage.rest()
    if not radius() > before:
        raise Failed(f"the wheel left the radius at {radius()}")
    stage.say(f"the wheel changed the radius from {before} to {radius()}")
    picture(stage, "5_radius", see=ground)
    more = dig()
    stage.say(f"with it they dug {more} voxels")
    if more[0] <= 1.5 * taken[0]:
        raise Failed(f"the larger pickaxe dug {more[0]} voxels at once, and the smaller one {taken[0]}")
    picture(stage, "6_larger", see=ground)

    for one in reversed(taken + more):
        since = stage.mark()
        tap(stage, "z")
        back = int(stage.wait(r"^history Undo removed=0 added=(\d+)", since).group(1))
        if back != one:
            raise Failed(f"a blow dug {one} voxels, and Z brought {back} back")
    stage.say(f"Z, {len(taken + more)} times, brought all {sum(taken + more)} voxels back")
    picture(stage, "7_undone", see=ground)
    where = [line for line in stage.lines()[began:] if line.startswith("eyes in ")]
    if "eyes in ground" in where or stage.last(r"^eyes in (\w+)").group(1) != "air":
        raise Failed(f"ground came over the player's eyes: {where}")
    stage.say("the player's eyes were in the air all the time")

    since = stage.mark()
    tap(stage, "6")
    stage.wait(r"^tool bomb", since)
    turn(0, -110)
    since = stage.mark()
    stage.press()
    stage.xdo("mouseup", 1)
    stage.say(f"a bomb dug {stage.wait(blows, since).group(1)} voxels")
    picture(stage, "8_crater", see=ground)
    tap(stage, "F1")
    picture(stage, "9_panel")
    tap(stage, "F1")
    since = stage.mark()
    tap(stage, "Escape")
    page("Paused Menu", since)
    picture(stage, "10_pause")

    since = stage.mark()
    for _ in range(4):
        tap(stage, "Down")
    tap(stage, "Return")
    page("Title Menu", since)
    picture(stage, "11_title", see=(60, 50, 35, 40))
    # The first item is lit: "Continue".
    since = stage.mark()
    tap(stage, "Down")
    tap(stage, "Return")
    stage.wait(r"^ready", since)
    page("Playing None", since)
    picture(stage, "12_new_game", see=ground)
    since = stage.mark()
    tap(stage, "z")
    stage.wait(r"^history there is nothing to undo", since)
    stage.say("a new game begins on land that nobody has dug")


@play("800x450")
def sculpt(stage):
    """Digs, drags the radius, digs again, does not dig through the panel, takes both strokes back."""
    ground = (40, 40, 20, 40)
    tool = r"^tool .*shape=(\w+) radius=([\d.]+)"
    radius = lambda: float(stage.last(tool).group(2))
    middle = (stage.size[0] / 2, stage.size[1] * 0.6)

    def dig(x, y):
        """A click, which is to take about the half of the brush's ball that is in the ground: voxels are of 1 m."""
        since = stage.mark()
        stage.click(x, y)
        removed = int(stage.wait(r"^stroke tag=\d+ removed=(\d+)", since).group(1))
        half = 2 / 3 * math.pi * radius() ** 3
        if not 0.7 < removed / half < 1.5:
            raise Failed(f"a radius of {radius()} m dug {removed} voxels, and not about {half:.0f}")
        stage.say(f"a click with a radius of {radius()} m dug {removed} voxels; half a ball has {half:.0f}")
        return removed

    stage.focus("sculpt")
    pristine = stage.wait(r"^ready hash=(\w+)").group(1)
    stage.wait(r'^place "Radius"')
    stage.wait(r"^dressed")
    picture(stage, "1_start", see=ground)
    dig(*middle)
    picture(stage, "2_dug", see=ground)

    before, strokes = radius(), stage.last(r"^stroke tag=(\d+)").group(1)
    left, top, right, bottom = stage.place("Radius")
    since, y = stage.mark(), (top + bottom) / 2
    stage.drag((left + (right - left) * 0.45, y), (left + (right - left) * 0.72, y), steps=3)
    stage.wait(r"^tool ", since)
    if not radius() >= 2 * before:
        raise Failed(f"the slider left the radius at {radius()}")
    stage.say(f"the slider changed the radius from {before} to {radius()}")
    # On the slider's name: panel, but nothing to push.
    since = stage.mark()
    stage.click(stage.place("Sphere")[0] + 6, y)
    stage.rest()
    if stage.last(r"^stroke tag=(\d+)").group(1) != strokes:
        raise Failed("a click on the panel dug into the ground behind it")
    if changes := [line for line in stage.lines()[since:] if line.startswith("tool ")]:
        raise Failed(f"a click beside the panel's widgets changed the brush: {changes}")
    if stage.last(tool).group(1) != "Sphere":
        raise Failed(f"the brush is no longer a sphere: {stage.last(tool).group(0)}")
    stage.say("clicks on the panel did not dig")
    # The brush is seen where the mouse points, as large as it is now.
    beside = (middle[0] + stage.size[0] * 0.05, middle[1])
    stage.move(*beside)
    picture(stage, "3_radius", see=ground)
    dig(*beside)
    picture(stage, "4_larger", see=ground)
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
    picture(stage, "5_undone", see=(40, 40, 20, 40))
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
    parser.add_argument("--size", help="of the window, in pixels; each play has its own")
    parser.add_argument("--patience", type=float, default=300, help="seconds to wait for each thing")
    parser.add_argument("arguments", nargs="*", help="for the program, after --")
    args = parser.parse_args()
    if args.list:
        for name, (function, _) in sorted(PLAYS.items()):
            print(f"{name:10} {function.__doc__}")
        return 0
    if args.play is None:
        parser.error("what is to be played?")
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    if missing:
        print(f"SKIPPED: nothing was driven, as {' and '.join(missing)} is not installed", file=sys.stderr)
        return SKIPPED
    act, size = PLAYS[args.play]
    size = tuple(map(int, (args.size or size).split("x")))
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    binary = args.binary or target / "release" / "examples" / args.play
    if not binary.exists():
        print(f"{binary} is not there: build it first, or name it with --binary", file=sys.stderr)
        return 1
    command = [str(binary), "--width", str(size[0]), "--height", str(size[1]), "--out", str(args.out), "--tell"]
    print(f"{args.play}: {binary}", flush=True)
    # Whoever is told to stop takes the program and the display along.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    start = time.monotonic()
    try:
        stage = Stage(command + args.arguments, args.out, size, args.patience)
    except (Failed, OSError) as error:
        print(f"FAILED: {error}", file=sys.stderr)
        return 1
    try:
        act(stage)
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
    print(f"{args.play}: {time.monotonic() - start:.0f} s, {stage.frames()} frames")
    return 0


if __name__ == "__main__":
    sys.exit(main())
