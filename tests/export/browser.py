"""A headless browser by the DevTools protocol over two pipes: pages opened from files, evaluated, pointed at and photographed."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import signal
import time
from pathlib import Path

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync --hide-scrollbars --enable-unsafe-swiftshader --remote-debugging-pipe"
)
REMARK = "GPU stall due to ReadPixels"
"""What the browser says of WebGL where it has no graphics processor."""

PATIENCE = 60
"""Seconds that a page may take to say that it is ready."""


class Browser:
    """A browser with one page. Use it in a with statement.

    said: whatever pages wrote to the console, and errors that nothing caught
    """

    def __init__(self, profile: Path) -> None:
        to_child, self._out = os.pipe()
        self._in, from_child = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (to_child, from_child)]
        actions = [(os.POSIX_SPAWN_DUP2, end, number) for end, number in zip(ends, (3, 4), strict=True)]
        quiet = [(os.POSIX_SPAWN_OPEN, number, os.devnull, os.O_WRONLY, 0) for number in (1, 2)]
        command = [CHROMIUM, *FLAGS.split(), f"--user-data-dir={profile}", "about:blank"]
        self._pid = os.posix_spawn(CHROMIUM, command, os.environ, file_actions=[*actions, *quiet], setpgroup=0)
        for end in (to_child, from_child, *ends):
            os.close(end)
        self._rest, self._count, self.said = b"", 0, []
        self._session = None
        (page,) = [target for target in self._call("Target.getTargets")["targetInfos"] if target["type"] == "page"]
        self._session = self._call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *problem: object) -> None:
        os.close(self._out)
        os.close(self._in)
        os.killpg(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)

    def open(self, path: Path, width: int = 1280, height: int = 800, dark: bool = False, fragment: str = "") -> None:
        """Show a file, and wait until its body says that it is ready; what was said before is forgotten.

        fragment: what follows the address, with its #
        """
        self.said.clear()
        narrow = width < 500
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=narrow)
        self._call("Emulation.setTouchEmulationEnabled", enabled=narrow)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[scheme])
        self._call("Page.navigate", url="about:blank")
        self._call("Page.navigate", url=path.as_uri() + fragment)
        self.wait(f"location.pathname === new URL({json.dumps(path.as_uri())}).pathname && document.body?.dataset.ready === 'true'")

    def wait(self, condition: str, seconds: float = PATIENCE) -> None:
        """Until an expression is true on the page."""
        end = time.monotonic() + seconds
        while not self.value(f"Boolean({condition})"):
            assert time.monotonic() < end, f"after {seconds} s not yet: {condition}; said: {self.said}"
            time.sleep(0.02)

    def value(self, expression: str) -> object:
        """What an expression is on the page; a promise is waited for."""
        found = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def worked(self) -> float:
        """Seconds of a processor that scripts and layout have taken so far, whatever else the machine did: those of the busiest page."""
        ticks = [0]
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                command, fields = stat.with_name("cmdline").read_bytes(), stat.read_text().rpartition(")")[2].split()
                if int(fields[2]) == self._pid and b"--type=renderer" in command:
                    main = (stat.parent / "task" / stat.parent.name / "stat").read_text().rpartition(")")[2].split()
                    ticks.append(int(main[11]) + int(main[12]))
            except OSError:  # a process that has ended meanwhile
                continue
        return max(ticks) / os.sysconf("SC_CLK_TCK")

    def press(self, key: str, code: str = "") -> None:
        """A key goes down and up."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key, **(text if kind == "keyDown" else {}))

    def mouse(self, kind: str, x: float, y: float, held: bool = True) -> None:
        """kind: mousePressed, mouseMoved or mouseReleased."""
        button = "left" if held or kind != "mouseMoved" else "none"
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=int(held), clickCount=1)

    def touch(self, kind: str, *places: tuple[float, float]) -> None:
        """kind: touchStart, touchMove or touchEnd."""
        self._call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in places])

    def photograph(self, path: Path, whole: bool = False) -> None:
        """A picture of what is seen, or of the whole page."""
        path.write_bytes(base64.b64decode(self._call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]))

    def _call(self, method: str, **arguments: object) -> dict:
        self._count += 1
        message = {"id": self._count, "method": method, "params": arguments}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        while True:
            answer = self._message()
            if answer.get("id") == self._count:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def _message(self) -> dict:
        while b"\0" not in self._rest:
            piece = os.read(self._in, 1 << 20)
            assert piece, "the browser has ended"
            self._rest += piece
        first, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(first)
        if message.get("method") in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"):
            if REMARK not in json.dumps(message["params"]):
                self.said.append(message["params"])
        return message
