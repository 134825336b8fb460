"""A headless Chromium, driven over its DevTools protocol on a pair of pipes."""

import base64
import fcntl
import json
import os
import shutil
import subprocess
import tempfile
import threading
import time

TIMEOUT_S = 20.0
"""For anything that should happen soon: generous, because test machines are busy."""

PROGRAM = shutil.which("chromium")


class Browser:
    """One page in a browser of its own."""

    def __init__(self, width: int = 1280, height: int = 900):
        assert PROGRAM, "Chromium is missing: install Debian's package chromium"
        self._profile = tempfile.TemporaryDirectory()
        reads, self._to = os.pipe()
        self._from, writes = os.pipe()
        command = [
            PROGRAM, "--headless=new", "--remote-debugging-pipe", "--no-first-run", "--mute-audio",
            "--disable-gpu", "--disable-background-networking", "--disable-component-update",
            f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}",
        ]
        if os.geteuid() == 0:
            # The browser's sandbox does not run as root.
            command.append("--no-sandbox")
        # The browser reads on 3 and writes on 4; none of these may be one of those.
        to_read, to_write = (fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (reads, writes))
        command = ["bash", "-c", f'exec "$@" 3<&{to_read} 4>&{to_write}', "bash", *command, "about:blank"]
        self.process = subprocess.Popen(
            command,
            pass_fds=(to_read, to_write),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in (reads, writes, to_read, to_write):
            os.close(end)
        self._answers: dict[int, dict] = {}
        self._news = threading.Condition()
        self._number = 0
        self._session = None
        self.problems: list[str] = []
        """What the page has complained about."""
        threading.Thread(target=self._read, daemon=True).start()
        targets = self._call("Target.getTargets")["targetInfos"]
        self._target = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self._call("Target.attachToTarget", targetId=self._target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_) -> None:
        self.process.kill()
        self.process.wait()
        for end in (self._to, self._from):
            os.close(end)
        # The browser's helpers may still write there for a moment.
        shutil.rmtree(self._profile.name, ignore_errors=True)

    def _read(self) -> None:
        rest = b""
        while data := self._take():
            *messages, rest = (rest + data).split(b"\0")
            for message in map(json.loads, messages):
                with self._news:
                    self._hear(message)
                    self._news.notify_all()

    def _take(self) -> bytes:
        try:
            return os.read(self._from, 1 << 16)
        except OSError:
            return b""

    def _hear(self, message: dict) -> None:
        params = message.get("params", {})
        match message.get("method"):
            case None:
                self._answers[message["id"]] = message
            case "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                self.problems.append(details.get("exception", details).get("description", str(details)))
            case "Runtime.consoleAPICalled" if params["type"] in ("error", "warning", "assert"):
                self.problems.append(str(params["args"]))
            case "Log.entryAdded" if params["entry"]["level"] in ("error", "warning"):
                self.problems.append(params["entry"]["text"])

    def _call(self, method: str, **params) -> dict:
        with self._news:
            self._number += 1
            number = self._number
            request = {"id": number, "method": method, "params": params}
            if self._session:
                request["sessionId"] = self._session
            os.write(self._to, json.dumps(request).encode() + b"\0")
            assert self._news.wait_for(lambda: number in self._answers, TIMEOUT_S), f"no answer to {method}"
            answer = self._answers.pop(number)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def open(self, url: str) -> None:
        self._call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete'")

    def leave(self) -> None:
        """Closes the page, as a person closes its tab; nothing can be asked of it afterwards."""
        self._session = None
        self._call("Target.closeTarget", targetId=self._target)

    def run(self, script: str):
        """Returns an expression's value, awaited."""
        answer = self._call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, f"{script}: {answer['exceptionDetails']}"
        return answer["result"].get("value")

    def wait(self, script: str, timeout: float = TIMEOUT_S) -> float:
        """Waits until an expression is true; returns the seconds that it took."""
        begin = time.monotonic()
        while not self.run(script):
            took = time.monotonic() - begin
            assert took < timeout, f"not within {timeout} s: {script}"
            time.sleep(0.02)
        return time.monotonic() - begin

    def text(self, selector: str) -> str:
        return self.run(f"document.querySelector({json.dumps(selector)}).textContent")

    def click(self, selector: str) -> None:
        self.run(f"document.querySelector({json.dumps(selector)}).click()")

    def box(self, selector: str) -> dict:
        rectangle = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{rectangle}.scrollIntoView({{ block: 'center' }})")
        return self.run(f"(({{x, y, width, height}}) => ({{x, y, width, height}}))({rectangle}.getBoundingClientRect())")

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Sends an event of the left button: mousePressed, mouseMoved or mouseReleased."""
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def press(self, selector: str, share: float) -> tuple[float, float]:
        """Presses and holds the mouse at a share of an element's width; returns where that is."""
        box = self.box(selector)
        at = (box["x"] + share * box["width"], box["y"] + box["height"] / 2)
        self.mouse("mousePressed", *at)
        return at

    def key(self, kind: str, key: str) -> None:
        """Sends an event of a key, as the element with the focus gets it: keyDown or keyUp."""
        self._call("Input.dispatchKeyEvent", type=kind, key=key, code={" ": "Space"}.get(key, key))

    def show(self, width: int, height: int, dark: bool) -> None:
        """Sets the size of the page, and the colour scheme that its reader prefers."""
        self._call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 500,
        )
        scheme = "dark" if dark else "light"
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self._call("Emulation.setEmulatedMedia", features=features)

    def picture(self) -> bytes:
        """Returns a screenshot, as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])
