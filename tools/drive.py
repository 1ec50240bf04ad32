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
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

from drive_stage import Failed, Stage

SKIPPED = 77
PLAYS = {}


def play(size, *arguments):
    """Enters a play under the name of its function, with the size of its window, as small as its widgets allow, and arguments for the
    program. In software the time of a frame depends on how much ground it shows."""

    def enter(function):
        PLAYS[function.__name__] = (function, size, arguments)
        return function

    return enter


def told(stage):
    """What the program has said, without what it says whenever somebody moves."""
    return [line for line in stage.lines() if not line.startswith(("aim ", "game ", "eyes ", "ground "))]


def picture(stage, name, see=None):
    """Takes a picture when the last report is on the screen: no pipeline waits, and four frames have passed in silence.

    The program reports a frame when it is done with it; it is drawn while the next one is made, and shown after that.
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
    if see and stage.contrast(see) < 0.01:
        raise Failed(f"nothing is to be seen in {stage.shots[-1]}")


def tap(stage, key):
    """A key, pressed and let go within a frame or two."""
    stage.xdo("key", "--delay", 0, key)
    stage.rest()


class Menu:
    """Selects items of the digger's menus by their names, with the arrow keys."""

    def __init__(self, stage):
        self.stage = stage

    def items(self):
        """The selected item's position, and the names of all items."""
        found = self.stage.last(r"^items (\d+) (\[.*\])$")
        return int(found.group(1)), json.loads(found.group(2))

    def select(self, name):
        at, names = self.items()
        if name not in names:
            raise Failed(f"the menu has no {name!r}: {names}")
        down = (names.index(name) - at) % len(names)
        key, times = ("Down", down) if down <= len(names) // 2 else ("Up", len(names) - down)
        for _ in range(times):
            since = self.stage.mark()
            self.stage.xdo("key", "--delay", 0, key)
            self.stage.wait(r"^items ", since)
        if self.items()[0] != names.index(name):
            raise Failed(f"the arrow keys don't lead to {name!r}: {self.items()}")

    def choose(self, name, page=None):
        """Activates an item, and waits for the page that it leads to."""
        self.select(name)
        if page:
            self.turn_to(page, "Return")
        else:
            tap(self.stage, "Return")

    def turn_to(self, page, key):
        """Presses a key, and waits for the page that it leads to and its items."""
        since = self.stage.mark()
        self.stage.xdo("key", "--delay", 0, key)
        self.stage.wait(r"^page " + page, since)
        self.stage.wait(r"^items ", since)
        self.stage.rest()

    def back(self, page, selected):
        """Escape, which leads to the page before this one, where the item is selected that led here."""
        self.turn_to(page, "Escape")
        at, names = self.items()
        if names[at] != selected:
            raise Failed(f"back on {page}, {names[at]!r} is selected, and not {selected!r}")

    def rest(self):
        self.stage.rest()
        self.stage.rest()

    def type(self, field, text):
        """Writes into a field, over what is there."""
        self.choose(field)
        self.stage.xdo("key", "--delay", 0, *["BackSpace"] * 24)
        self.stage.rest()
        self.stage.xdo("type", "--delay", 1, text)
        self.stage.rest()
        tap(self.stage, "Return")


class Player:
    """Looks around in the digger, and uses tools."""

    def __init__(self, stage):
        self.stage = stage

    def turn(self, right, down):
        self.stage.xdo("mousemove_relative", "--", right, down)
        self.stage.rest()

    def aim(self):
        return float(self.stage.last(r"^aim ([\d.]+|none)").group(1).replace("none", "inf"))

    def look_down(self, to):
        """Until what is aimed at is no farther away: the ground before the feet, but not that below them."""
        for _ in range(40):
            if self.aim() <= to:
                return
            self.turn(0, 30 if self.aim() < 3 * to else 90)
        raise Failed(f"the ground is {self.aim()} m away, however far one looks down")

    def use(self, pattern):
        """Holds the button until the program says so."""
        since = self.stage.mark()
        self.stage.xdo("mousedown", 1)
        found = self.stage.wait(pattern, since)
        self.stage.xdo("mouseup", 1)
        self.stage.rest()
        return found

    def take(self, key, tool):
        since = self.stage.mark()
        self.stage.xdo("key", "--delay", 0, key)
        self.stage.wait(r"^tool " + tool, since)


def fits(stage):
    """All texts of the page that opened last are within their boxes and the window, and none is over another. With --pictures, it is shot too."""
    stage.wait(r"^texts end", stage.page_mark)
    lines = stage.lines()
    end = max(at for at, line in enumerate(lines) if line == "texts end")
    found = []
    for line in reversed(lines[:end]):
        match = re.match(r"^text (\".*\")((?: -?\d+){8})$", line)
        if not match:
            break
        found.append((json.loads(match.group(1)), *map(int, match.group(2).split())))
    for text, left, top, right, bottom, *behind in found:
        if left < 0 or top < 0 or right > stage.size[0] or bottom > stage.size[1]:
            raise Failed(f"{text!r} is cut: {left} {top} {right} {bottom}")
        if left < behind[0] or top < behind[1] or right > behind[2] or bottom > behind[3]:
            raise Failed(f"{text!r} at {left} {top} {right} {bottom} is not all within its box, {behind}")
    for at, (one, *a) in enumerate(found):
        for other, *b in found[at + 1:]:
            wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
            if wide > 2 and high > 2:
                raise Failed(f"{one!r} is over {other!r}: {a} {b}")
            # Boxes are apart, or one is within the other.
            c, d = a[4:], b[4:]
            both = [max(c[0], d[0]), max(c[1], d[1]), min(c[2], d[2]), min(c[3], d[3])]
            if both[2] - both[0] > 2 and both[3] - both[1] > 2 and both not in (c, d):
                raise Failed(f"the box of {one!r} is over that of {other!r}: {c} {d}")
    if not found:
        raise Failed("no text is to be seen")
    if stage.takes_all:
        stage.rest()
        page = stage.last(r"^page (\w+) (\w+)")
        stage.shoot(f"{len(stage.shots):02}_{page.group(1)}_{page.group(2)}")


@play("400x225")
def digger(stage):
    """Every menu page, every tool, saved worlds, settings that survive, and a guest on the same machine."""
    menu, player = Menu(stage), Player(stage)
    blows = r"^edit tag=\d+ removed=([1-9]\d*)"
    game = r"^game headlamp=(\w+) lamps=(\d+) players=(\d+) place=(\S+ \S+ \S+|none) world=(.*)$"

    def page(name, since):
        stage.wait(r"^page " + name, since)

    def begin():
        """The program is there, with its title."""
        since = stage.mark()
        stage.wait(r"^ready", since)
        stage.focus("Digger")
        menu.rest()

    def pages():
        """Each page of the title fits, leads back by Escape, and the title remembers where one was."""
        _, names = menu.items()
        if names != ["Play", "New world", "Worlds", "Multiplayer", "Settings", "Controls", "Help", "Quit"]:
            raise Failed(f"the title of a first start has {names}")
        for name, page_name in (
            ("Settings", "Settings"), ("Controls", "Controls"), ("Help", "Help"), ("Worlds", "Worlds"),
            ("New world", "NewWorld"), ("Multiplayer", "Together"),
        ):
            stage.page_mark = stage.mark()
            menu.choose(name, f"Title {page_name}")
            fits(stage)
            if name == "Settings":
                for _ in range(3):
                    tap(stage, "Right")
            if name in ("Settings", "Controls"):
                stage.page_mark = stage.mark()
                menu.choose("Reset", "Title Question")
                fits(stage)
                menu.back(f"Title {page_name}", "Reset")
            if name == "Worlds" and menu.items()[1] != ["Back"]:
                raise Failed(f"nobody has played, and there are worlds: {menu.items()[1]}")
            menu.back("Title Menu", name)
        if menu.items()[1][0] != "Play":
            raise Failed("nothing was played, and there is something to continue")
        stage.say("each page of the title fits, leads back by Escape, and is remembered; resets ask first")

    def tools():
        """Each tool does its work, or says why it does not."""
        since = stage.mark()
        player.turn(0, -700)
        player.use(r"^hint Too far away")
        player.turn(0, 800)
        player.look_down(5.4)
        taken = int(player.use(blows).group(1))
        stage.say(f"out of reach there is a hint; the pickaxe dug {taken} voxels")
        player.take("5", "painter")
        tap(stage, "e")
        tap(stage, "e")
        player.use(r"^hint Not enough sand")
        tap(stage, "q")
        tap(stage, "q")
        player.take("2", "shovel")
        player.look_down(7)
        player.use(r"^edit ")
        player.take("3", "drill")
        player.look_down(6)
        player.use(blows)
        player.take("4", "builder")
        for _ in range(5):
            tap(stage, "e")
        player.turn(150, -60)
        player.look_down(12)
        player.use(r"^edit tag=\d+ removed=0 added=[1-9]")
        since = stage.mark()
        tap(stage, "z")
        stage.wait(r"^history Undo", since)
        player.take("6", "bomb")
        stage.say(f"a bomb dug {player.use(blows).group(1)} voxels")
        player.take("7", "lamp")
        player.turn(400, 0)
        player.look_down(9)
        player.use(r"^game .*lamps=1")
        player.take("8", "ball")
        stage.xdo("click", "--delay", 0, 1)
        stage.rest()
        since = stage.mark()
        tap(stage, "f")
        stage.wait(r"^game headlamp=true", since)
        stage.say("all tools worked")
        player.take("4", "builder")
        tap(stage, "F1")
        picture(stage, "panel")
        tap(stage, "F1")
        picture(stage, "play", see=(30, 25, 30, 30))

    def display():
        """Pictures of the display, the panel, the pause, and of pages with a world."""
        picture(stage, "play")
        player.turn(0, -700)
        player.use(r"^hint Too far away")
        stage.shoot("hint")
        tap(stage, "F1")
        picture(stage, "panel")
        tap(stage, "F1")
        to_title()
        for name, page_name, key in (("Worlds", "Worlds", "Return"), ("world 1", "World", "Right")):
            stage.page_mark = stage.mark()
            menu.select(name)
            menu.turn_to(f"Title {page_name}", key)
            fits(stage)

    def pause():
        stage.page_mark = stage.mark()
        menu.turn_to("Paused Menu", "Escape")
        fits(stage)

    def to_title():
        pause()
        menu.choose("Main menu", "Title Menu")

    def world():
        return stage.last(game).group(5)

    def check_game(expected, what):
        """Place, lamps, headlamp and tool are as they were left."""
        headlamp, lamps, _, place, _ = stage.last(game).groups()
        tool = stage.last(r"^tool (\w+)").group(1)
        near = all(abs(float(a) - float(b)) <= 2 for a, b in zip(place.split(), expected[2].split()))
        if (headlamp, lamps, tool) != (expected[0], expected[1], "builder") or not near:
            raise Failed(f"{what}: {(headlamp, lamps, place, tool)}, and not {expected}")

    def worlds():
        """New, pick, rename, duplicate, delete."""
        left = stage.last(game).group(1, 2, 4)
        to_title()
        folder = pathlib.Path(stage.env["XDG_DATA_HOME"]) / "bevy_burrow" / "worlds"
        deadline = time.monotonic() + 20
        while not (folder / "world 1" / "thumbnail.png").exists():
            if time.monotonic() > deadline:
                raise Failed("the pause took no picture of the world")
            time.sleep(0.1)
        menu.choose("New world", "Title NewWorld")
        menu.type("Name", "Hill")
        menu.type("Seed", "7")
        since = stage.mark()
        menu.choose("Create and play")
        page("Playing None", since)
        stage.wait(r"^game .*place=[-\d].* world=Hill", since)
        stage.say("a new world with a name and a seed is played")
        to_title()
        stage.page_mark = stage.mark()
        menu.choose("Worlds", "Title Worlds")
        fits(stage)
        if menu.items()[1][:2] != ["Hill", "world 1"]:
            raise Failed(f"the worlds are {menu.items()[1]}")
        since = stage.mark()
        menu.choose("world 1")
        page("Playing None", since)
        stage.wait(r"^game .*place=[-\d].* world=world 1", since)
        menu.rest()
        check_game(left, "a world that was picked")
        stage.say("picking a world plays it, where it was left, with tool, lamps and headlamp")
        to_title()
        menu.choose("Worlds", "Title Worlds")
        menu.select("Hill")
        stage.page_mark = stage.mark()
        menu.turn_to("Title World", "Right")
        fits(stage)
        menu.type("Name", "Mound")
        menu.back("Title Worlds", "Mound")
        menu.select("Mound")
        menu.turn_to("Title World", "Right")
        menu.choose("Duplicate", "Title Worlds")
        names = menu.items()[1]
        if "Mound copy" not in names or "Mound" not in names:
            raise Failed(f"after a copy, the worlds are {names}")
        menu.select("Mound copy")
        menu.turn_to("Title World", "Right")
        stage.page_mark = stage.mark()
        menu.choose("Delete", "Title Question")
        fits(stage)
        menu.back("Title World", "Delete")
        menu.choose("Delete", "Title Question")
        menu.choose("Delete", "Title Worlds")
        if "Mound copy" in menu.items()[1]:
            raise Failed("a world that was deleted is listed")
        stage.say("worlds are renamed, copied, and deleted after a question")
        menu.turn_to("Title Menu", "Escape")
        return left

    def restart(left):
        """Quits, and starts again: settings and the game are as they were left."""
        menu.select("Quit")
        stage.xdo("key", "--delay", 0, "Return")
        stage.wait_for_end()
        settings = json.loads((stage.out / "config" / "bevy_burrow" / "digger.json").read_text())
        if abs(settings["sensitivity"] - 1.3) > 0.01:
            raise Failed(f"the sensitivity is {settings['sensitivity']}")
        stage.run()
        begin()
        if menu.items()[1][0] != "Continue world 1":
            raise Failed(f"after a restart, the title has {menu.items()[1]}")
        menu.choose("Continue world 1", "Playing None")
        menu.rest()
        check_game(left, "after a restart")
        stage.say("settings and the game survive a restart")

    def see_the_same(guest):
        deadline = time.monotonic() + stage.patience
        while stage.last(r"^ground .*").group(0) != guest.last(r"^ground .*").group(0):
            if time.monotonic() > deadline:
                raise Failed("host and guest see different ground")
            time.sleep(0.1)

    def together():
        """Hosts the world from the menu, and a guest joins it from another program's menu."""
        to_title()
        stage.page_mark = stage.mark()
        menu.choose("Multiplayer", "Title Together")
        menu.choose("Host this world", "Playing None")
        out = stage.out / "guest"
        guest = Stage(stage.command, out, stage.size, stage.patience, beside=stage)
        try:
            theirs = Menu(guest)
            guest.wait(r"^ready")
            guest.focus("Digger")
            theirs.rest()
            theirs.choose("Multiplayer", "Title Together")
            theirs.type("Your name", "Ann")
            theirs.type("Host address", "nowhere")
            theirs.choose("Join")
            theirs.type("Host address", "127.0.0.1")
            theirs.choose("Join", "Playing None")
            guest.wait(r"^game .*players=2")
            stage.wait(r"^game .*players=2")
            stage.wait(r"^hint Ann has joined")
            digger = Player(guest)
            digger.turn(0, 800)
            digger.look_down(5.4)
            digger.use(blows)
            see_the_same(guest)
            stage.say("a guest joined from the menu and dug, and both see the same")
            # Who loses the keyboard is paused.
            stage.focus("Digger")
            menu.rest()
            stage.page_mark = stage.mark()
            menu.choose("Multiplayer", "Paused Together")
            fits(stage)
            since = guest.mark()
            menu.choose("Stop hosting", "Playing None")
            guest.wait(r"^hint The host can.t be reached", since)
            pause()
            menu.choose("Multiplayer", "Paused Together")
            since = stage.mark()
            menu.choose("Host this world", "Playing None")
            stage.wait(r"^game .*players=2 ", since)
            guest.focus("Digger")
            theirs.rest()
            theirs.turn_to("Playing None", "Escape")
            digger.use(blows)
            see_the_same(guest)
            stage.say("the host begins anew, and the guest returns and digs")
        finally:
            guest.close()

    stage.wait(r"^painted")
    stage.say("the land is painted")
    stage.wait(r"^ready")
    stage.focus("Digger")
    menu.rest()
    picture(stage, "title", see=(60, 50, 35, 40))
    pages()
    since = stage.mark()
    menu.choose("Play")
    page("Playing None", since)
    # The title was there for some frames more.
    stage.page_mark = stage.lines().index("page Playing None", since)
    fits(stage)
    if world() != "world 1":
        raise Failed(f"the first world is {world()!r}")
    if stage.takes_all:
        display()
        return
    tools()
    left = worlds()
    restart(left)
    together()


@play("800x640", "--cells", "96")
def sculpt(stage):
    """Every operation and shape, a held stroke and its undo, questions, save, open, quit with unsaved work."""
    tool = r"^tool operation=(\w+) shape=(\w+) radius=([\d.]+)"
    strokes = r"^stroke tag=(\d+) .*hash=(\w+)"
    middle = (stage.size[0] / 2, stage.size[1] * 0.6)

    def hash_now():
        lines = [line for line in stage.lines() if re.match(r"^(stroke|undo|redo|ready) .*hash=", line)]
        return lines[-1].rsplit("hash=", 1)[1]

    def press_key(key, pattern):
        since = stage.mark()
        stage.xdo("key", "--delay", 0, key)
        return stage.wait(pattern, since)

    def dig(x, y):
        since = stage.mark()
        stage.click(x, y)
        return stage.wait(strokes, since)

    def settle():
        """Until no receipt comes any more."""
        while True:
            since = stage.mark()
            for _ in range(2):
                stage.rest()
            if not any(line.startswith("stroke ") for line in stage.lines()[since:]):
                return

    shutil.rmtree(stage.out / "level", ignore_errors=True)
    stage.focus("sculpt")
    pristine = stage.wait(r"^ready hash=(\w+)").group(1)
    stage.wait(r'^place "Dig"')
    stage.wait(r"^dressed")
    picture(stage, "start", see=(40, 40, 20, 40))

    if stage.takes_all:
        for key in ("0", "F1"):
            tap(stage, key)
            stage.move(*middle)
            picture(stage, key)
        tap(stage, "F1")
        dig(*middle)
        settle()
        tap(stage, "Escape")
        picture(stage, "question")
        return
    stage.move(*middle)
    stage.press()
    stage.wait(r"^stroke tag=3 ", 0)
    stage.release()
    settle()
    dabs = [line for line in stage.lines() if line.startswith("stroke ")]
    since = stage.mark()
    stage.chord("ctrl", "z")
    back = stage.wait(r"^undo .*hash=(\w+)", since).group(1)
    if back != pristine:
        raise Failed(f"one step back from a stroke of {len(dabs)} brushes is {back}, and not {pristine}")
    since = stage.mark()
    stage.click(*stage.middle("Redo"))
    stage.wait(r"^redo .*hash=", since)
    stage.say(f"a held stroke of {len(dabs)} brushes is one step of undo")
    stage.move(*middle)
    picture(stage, "stroke")

    operations = ["Dig", "Add", "Paint", "Smooth", "Sharpen", "Flatten", "Level", "Raise", "Lower", "Stamp", "Terrace"]
    for key, operation in zip(["1", "2", "3", "4", "5", "6", "7", "8", "9", "0", "minus"], operations):
        if operation != "Dig":
            press_key(key, rf"^tool operation={operation} ")
        if operation == "Paint":
            stage.rest()
            since = stage.mark()
            stage.click(*stage.middle("Clay"))
            stage.wait(r"^tool .*material=4", since)
        before = hash_now()
        dig(*middle)
        if hash_now() == before:
            raise Failed(f"{operation} changes nothing")
    stage.say("each operation is chosen by its key, and changes the ground")
    picture(stage, "operations", see=(40, 40, 20, 40))
    press_key("1", r"^tool operation=Dig ")

    def click_with(modifier, pattern, right=0):
        """A click while a key is held."""
        stage.xdo("keydown", modifier)
        stage.rest()
        since = stage.mark()
        stage.click(middle[0] + right, middle[1])
        found = stage.wait(pattern, since)
        stage.xdo("keyup", modifier)
        stage.rest()
        return found

    click_with("shift", r"^stroke .*removed=0 added=[1-9]")
    click_with("ctrl", strokes)
    tag = int(stage.last(strokes).group(1))
    click_with("l", rf"^stroke tag={tag + 3} ", right=60)
    settle()
    click_with("alt", r"^tool .*material=[^4]", right=-70)
    stage.place("Under the pointer")
    stage.say("Shift inverts, Ctrl smooths, L draws a line, Alt picks the material, and the pointer's place is shown")
    for shape in ("Box", "Cylinder", "Capsule", "Cone", "Torus"):
        since = stage.mark()
        stage.click(*stage.middle(shape))
        stage.wait(rf"^tool .*shape={shape} ", since)
        dig(middle[0] + 20, middle[1])
    press_key("0", r"^tool operation=Stamp ")
    # Each operation has rows of its own above the shapes.
    stage.rest()
    since = stage.mark()
    stage.click(*stage.middle("Box"))
    stage.wait(r"^tool .*shape=Box ", since)
    since = stage.mark()
    stage.click(*stage.middle("Torus"))
    stage.rest()
    stage.rest()
    if any(line.startswith("tool ") for line in stage.lines()[since:]):
        raise Failed("a stamp takes a torus")
    stage.say("each shape works, and a torus can't be a stamp")

    # A placed brush is moved by its handles, and applied and released by keys.
    press_key("2", r"^tool operation=Add ")
    stage.move(*middle)
    before = hash_now()
    at = press_key("g", r"^tool .*placed=(\[.*\])").group(1)
    for handle, (right, down) in {"Move along x": (40, 10), "Move along y": (0, -30), "Scale along x": (20, 5)}.items():
        stage.rest()
        stage.rest()
        since = stage.mark()
        x, y = stage.middle(handle)
        stage.drag((x, y), (x + right, y + down), steps=2)
        line = stage.wait(r"^tool .*radius=([\d.]+) .*placed=(\[.*\])", since)
        stage.say(f"{handle}: {line.group(0)}")
    stage.rest()
    if stage.last(r"^tool .*placed=(\[.*\])").group(1) == at:
        raise Failed("the handles have moved nothing")
    if hash_now() != before:
        raise Failed("dragging a handle changes the ground")
    since = stage.mark()
    stage.click(middle[0] - 80, middle[1] + 60)
    stage.rest()
    stage.rest()
    if any(line.startswith("stroke ") for line in stage.lines()[since:]):
        raise Failed("a click beside a placed brush changes the ground")
    picture(stage, "placed")
    if press_key("Return", strokes).group(2) == before:
        raise Failed("applying a placed brush changes nothing")
    settle()
    since = stage.mark()
    stage.chord("ctrl", "z")
    if stage.wait(r"^undo .*hash=(\w+)", since).group(1) != before:
        raise Failed("a placed brush is more than one step of undo")
    press_key("End", r"^tool .*placed=\[")
    press_key("Escape", r"^tool .*placed=no")
    stage.say("a brush is placed, dragged by its handles, applied, undone, moved to the ground and released")

    # A road is a path: clicks are points, Enter makes one edit of them.
    press_key("equal", r"^tool operation=Road ")
    for right in (-60, 0, 60):
        since = stage.mark()
        stage.click(middle[0] + right, middle[1])
        stage.wait(r"^tool operation=Road ", since)
        stage.rest()
    since, before = stage.mark(), hash_now()
    stage.xdo("key", "--delay", 0, "Return")
    stage.wait(strokes, since)
    if hash_now() == before:
        raise Failed("a road changes nothing")
    since = stage.mark()
    stage.chord("ctrl", "z")
    if stage.wait(r"^undo .*hash=(\w+)", since).group(1) != before:
        raise Failed("a road is more than one step of undo")
    stage.rest()
    since = stage.mark()
    stage.chord("ctrl", "c")
    stage.wait(r"^tool operation=Paste ", since)
    stage.rest()
    dig(middle[0] - 50, middle[1])
    before = hash_now()
    press_key("r", r"^tool operation=Reset ")
    dig(*middle)
    if hash_now() == before:
        raise Failed("a reset changes nothing")
    stage.say("a path is one edit, what is copied is pasted, and ground is reset")
    for key, operation in (("x", "Clear"), ("u", "Merge"), ("v", "Carve")):
        press_key(key, rf"^tool operation={operation} ")
        before = hash_now()
        dig(middle[0] + 40, middle[1])
        if hash_now() == before:
            raise Failed(f"{operation} changes nothing")
    press_key("2", r"^tool operation=Add ")
    stage.rest()
    since = stage.mark()
    stage.click(*stage.middle("Model"))
    stage.wait(r"^tool .*shape=Model ", since)
    before = hash_now()
    dig(*middle)
    if hash_now() == before:
        raise Failed("a model changes nothing")
    stage.say("plants are cleared, edges are rounded, and a model is built")
    picture(stage, "paste")
    press_key("1", r"^tool operation=Dig ")
    stage.rest()

    before = float(stage.last(tool).group(3))
    since = stage.mark()
    stage.click(*stage.middle("Sphere"))
    stage.wait(r"^tool .*shape=Sphere", since)
    left, top, right, bottom = stage.place("Radius")
    since, y = stage.mark(), (top + bottom) / 2
    stage.drag((left + (right - left) * 0.45, y), (left + (right - left) * 0.72, y), steps=2)
    stage.wait(r"^tool ", since)
    if not float(stage.last(tool).group(3)) >= 1.5 * before:
        raise Failed("the slider left the radius as it was")

    def asked(since):
        stage.wait(r'^place "Discard changes"', since)
        stage.rest()

    # Escape asks, and takes the question back.
    since = stage.mark()
    tap(stage, "Escape")
    asked(since)
    picture(stage, "question")
    since = stage.mark()
    tap(stage, "Escape")
    stage.rest()
    stage.rest()
    if stage.program.poll() is not None:
        raise Failed("Escape quits, and work is lost")
    stage.chord("ctrl", "s")
    folder = stage.out / "level"
    deadline = time.monotonic() + stage.patience
    while not any(folder.glob("*")):
        if time.monotonic() > deadline:
            raise Failed("Ctrl+S did not save")
        time.sleep(0.1)
    settle()
    saved = hash_now()
    stage.say("Escape asks before work is lost, and Ctrl+S saves")
    dig(*middle)
    settle()
    since = stage.mark()
    stage.chord("ctrl", "o")
    asked(since)
    since = stage.mark()
    stage.click(*stage.middle("Discard changes"))
    opened = stage.wait(r"^ready hash=(\w+)", since).group(1)
    if opened != saved:
        raise Failed(f"what was saved has the hash {saved}, and what was opened {opened}")
    stage.say("Ctrl+O asks, and brings back what was saved")
    stage.move(*middle)
    dig(*middle)
    settle()
    since = stage.mark()
    tap(stage, "Escape")
    asked(since)
    stage.click(*stage.middle("Discard changes"))
    stage.wait_for_end()
    stage.say("quitting with unsaved work asks first")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("play", nargs="?", choices=sorted(PLAYS), help="what to play")
    parser.add_argument("--list", action="store_true", help="list the plays")
    parser.add_argument("--binary", type=pathlib.Path, help="the example's program")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/drive"), help="folder for pictures and log")
    parser.add_argument("--size", help="of the window, in pixels; each play has its own")
    parser.add_argument("--scale", type=float, default=1, help="of the display and of the texts, for pictures")
    parser.add_argument("--patience", type=float, default=300, help="seconds to wait for each thing")
    parser.add_argument("--pictures", action="store_true", help="take a picture of every page, and play no further")
    parser.add_argument("arguments", nargs="*", help="for the program, after --")
    args = parser.parse_args()
    if args.list:
        for name, (function, *_) in sorted(PLAYS.items()):
            print(f"{name:10} {function.__doc__}")
        return 0
    if args.play is None:
        parser.error("what is to be played?")
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    if missing:
        print(f"SKIPPED: nothing was driven, as {' and '.join(missing)} is not installed", file=sys.stderr)
        return SKIPPED
    act, size, arguments = PLAYS[args.play]
    size = tuple(map(int, (args.size or size).split("x")))
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    binary = args.binary or target / "release" / "examples" / args.play
    if not binary.exists():
        print(f"{binary} is not there: build it first, or name it with --binary", file=sys.stderr)
        return 1
    logical = [str(round(side / args.scale)) for side in size]
    command = [str(binary), "--width", logical[0], "--height", logical[1], "--out", str(args.out), "--tell"]
    print(f"{args.play}: {binary}", flush=True)
    # A signal to stop also ends the program and the display.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    start = time.monotonic()
    try:
        stage = Stage(command + [*arguments, *args.arguments], args.out, size, args.patience, scale=args.scale)
    except (Failed, OSError) as error:
        print(f"FAILED: {error}", file=sys.stderr)
        return 1
    stage.takes_all = args.pictures
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
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = used.ru_utime + used.ru_stime
    print(f"{args.play}: {time.monotonic() - start:.0f} s, {busy:.0f} s of processor time, {stage.frames()} frames")
    return 0


if __name__ == "__main__":
    sys.exit(main())
