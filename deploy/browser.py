"""A headless Chromium, driven through its pipe: what it needs to draw a page and to hand over the picture."""
import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
MISSING = "there is no Chromium on this machine (apt install chromium), and it draws the pictures"


def find_chromium():
    """Its program, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


def away_from_the_pipe(descriptor):
    """The same file at a descriptor that is not one of those that Chromium's pipe takes."""
    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(descriptor)
    return moved


class Browser:
    """One page in a browser of its own, which ends with the block; its profile is a folder that is removed."""

    def __init__(self, chromium, width, height, theme, **options):
        self.profile = tempfile.TemporaryDirectory(prefix="tenon-chromium-")
        told, self.to = map(away_from_the_pipe, os.pipe())
        self.answers, tells = map(away_from_the_pipe, os.pipe())
        words = [chromium, "--headless=new", "--remote-debugging-pipe", f"--user-data-dir={self.profile.name}", "--no-first-run", "--hide-scrollbars",
                 "--disable-dev-shm-usage", "--enable-unsafe-swiftshader", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        # bash, since other shells have descriptors of one digit alone
        self.process = subprocess.Popen(["bash", "-c", f'exec "$@" 3<&{told} 4>&{tells}', "bash", *words], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL, pass_fds=(told, tells), **options)
        os.close(told)
        os.close(tells)
        self.unread, self.asked, self.session = b"", 0, None
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.close(self.to)
        os.close(self.answers)
        for last in (False,) * 50 + (True,):  # its children end after it, and write until then
            try:
                return self.profile.cleanup()
            except OSError:
                if last:
                    raise
                time.sleep(0.1)

    def ask(self, method, seconds=120, **parameters):
        """The result of a command of the DevTools protocol. Fails with a sentence."""
        self.asked += 1
        message = {"id": self.asked, "method": method, "params": parameters, **({"sessionId": self.session} if self.session else {})}
        os.write(self.to, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + seconds
        while True:
            while b"\0" in self.unread:
                text, _, self.unread = self.unread.partition(b"\0")
                answer = json.loads(text)
                if answer.get("id") == self.asked:
                    if "error" in answer:
                        raise RuntimeError(f"the browser refuses {method}: {answer['error'].get('message')}")
                    return answer["result"]
            if not select.select([self.answers], [], [], max(0, end - time.monotonic()))[0]:
                raise RuntimeError(f"the browser does not answer {method}")
            read = os.read(self.answers, 1 << 16)
            if not read:
                raise RuntimeError("the browser has ended")
            self.unread += read

    def open(self, address):
        self.ask("Page.navigate", url=address)

    def value(self, expression):
        """What an expression is in the page, as JSON has it; None while the page has no such thing."""
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def picture(self):
        """The page as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])
