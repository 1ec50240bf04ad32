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
import shutil
import subprocess
import sys

from drive_stage import Failed, Stage

SKIPPED = 77
PLAYS = {}


def play(function):
    """Enters a play under the name of its function."""
    PLAYS[function.__name__] = function
    return function


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
