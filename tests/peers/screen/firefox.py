"""A headless Firefox over WebDriver BiDi, as far as the pages' rules need it."""
import itertools, json, re, subprocess, tempfile

import websocket


class Firefox:
    def __init__(self):
        self.profile = tempfile.TemporaryDirectory()
        command = ["firefox-esr", "--headless", "--no-remote", "--profile", self.profile.name, "--remote-debugging-port", "0", "--width", "1280", "--height", "800"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        for line in self.process.stderr:
            found = re.search(r"WebDriver BiDi listening on (ws://\S+)", line)
            if found:
                break
        else:
            raise AssertionError("Firefox has ended without an address for its driver")
        self.socket = websocket.create_connection(found[1] + "/session", suppress_origin=True, timeout=60)
        self.numbers = itertools.count(1)
        self.call("session.new", capabilities={})
        self.context = self.call("browsingContext.getTree")["contexts"][0]["context"]

    def call(self, method, **params):
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("id") == number:
                assert answer["type"] == "success", answer
                return answer["result"]

    def get(self, address):
        self.call("browsingContext.navigate", context=self.context, url=address, wait="complete")

    def execute_script(self, text):
        """Runs the body of a function; its value comes back through JSON."""
        answer = self.call("script.evaluate", target={"context": self.context}, awaitPromise=False,
                           expression=f"JSON.stringify((() => {{ {text} }})() ?? null)")
        assert answer["type"] == "success", answer
        return json.loads(answer["result"]["value"])

    def quit(self):
        self.socket.close()
        self.process.terminate()
        self.process.wait()
        self.profile.cleanup()
