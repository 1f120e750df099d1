"""A headless chromium led over its debugging protocol: pages are opened, clicked, looked at, and overheard."""

import asyncio
import base64
import io
import json
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
from PIL import Image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--no-first-run --disable-background-networking --disable-component-update --remote-debugging-port=0"
)


class Browser:
    """One page; use it in a ``with``.

    Attributes
    ----------
    requests : list of str
        Addresses that the page asked for, apart from the file itself and what it holds.
    complaints : list of str
        Errors and uncaught exceptions on the console.
    """

    def __init__(self, folder: Path, size: tuple[int, int] = (900, 640), network: bool = False) -> None:
        self.folder, self.size, self.network = folder, size, network
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._number = 0

    def __enter__(self) -> "Browser":
        assert CHROMIUM is not None
        width, height = self.size
        words = [CHROMIUM, *FLAGS.split(), f"--user-data-dir={self.folder}", f"--window-size={width},{height}"]
        if not self.network:
            words.append("--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1")
        self.process = subprocess.Popen([*words, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.loop = asyncio.new_event_loop()
        port_file = self.folder / "DevToolsActivePort"
        self._wait(port_file.is_file, 30)
        port = port_file.read_text().split()[0]
        self._wait(lambda: self._targets(port) != [], 30)
        self.loop.run_until_complete(self._connect(self._targets(port)[0]["webSocketDebuggerUrl"]))
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()
        self.loop.run_until_complete(asyncio.sleep(0.1))  # until the connection is closed
        self.process.terminate()
        self.process.wait(20)
        self.loop.close()

    @staticmethod
    def _wait(done: Any, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, "chromium does not answer"
            time.sleep(0.1)

    @staticmethod
    def _targets(port: str) -> list[Any]:
        with urlopen(f"http://127.0.0.1:{port}/json") as answer:
            return [one for one in json.load(answer) if one["type"] == "page"]

    async def _connect(self, url: str) -> None:
        from tornado.websocket import websocket_connect

        self.socket = await websocket_connect(url, max_message_size=256 * 1024 * 1024)

    def call(self, method: str, **parameters: Any) -> Any:
        """A command of the protocol and its result; events on the way are noted."""
        return self.loop.run_until_complete(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> Any:
        self._number += 1
        number = self._number
        await self.socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(await asyncio.wait_for(self.socket.read_message(), 60))
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _note(self, event: dict[str, Any]) -> None:
        kind, given = event.get("method"), event.get("params", {})
        if kind == "Network.requestWillBeSent":
            url = given["request"]["url"]
            if not url.startswith(("file:", "data:", "blob:", "about:")):
                self.requests.append(url)
        elif kind == "Runtime.exceptionThrown":
            self.complaints.append(str(given["exceptionDetails"].get("exception", given["exceptionDetails"])))
        elif kind == "Runtime.consoleAPICalled" and given["type"] == "error":
            self.complaints.append(str(given["args"]))
        elif kind == "Log.entryAdded" and given["entry"]["level"] == "error":
            self.complaints.append(given["entry"]["text"])

    def open(self, url: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=url)

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait_for(self, script: str, seconds: float = 60.0) -> None:
        """Wait until an expression is true."""
        self._wait(lambda: self.evaluate(script), seconds)

    def place(self, selector: str) -> dict[str, float]:
        """Left, top, width and height of an element."""
        script = f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
        found: dict[str, float] = self.evaluate(script + " return {x: b.x, y: b.y, w: b.width, h: b.height} })()")
        return found

    def click(self, selector: str, across: float = 0.5) -> None:
        """Press and release the mouse on an element, at a part of its width."""
        box = self.place(selector)
        at = {"x": box["x"] + across * box["w"], "y": box["y"] + 0.5 * box["h"], "button": "left", "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type="mousePressed", **at)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", **at)

    def picture(self, file: Path | None = None) -> np.ndarray:
        """What is seen, (height, width, 3)."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if file is not None:
            file.write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
