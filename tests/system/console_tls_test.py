"""The console for other machines: its certificate, https and wss, and what it refuses."""
import json
import os
import shutil
import socket
import ssl
import stat
import subprocess
import time
import unittest

from console_test import Browser, SCENARIO, TOOLS, memory, pass_of, start_console
from stage import Stage, tenon
from viewer import Refused, Viewer, connect, get, request


def certificates(folder, *names):
    """Of `tenon cert`: the authority, and what --tls takes."""
    done = tenon("cert", "--out", folder, *names)
    assert done.returncode == 0, done.stderr
    return folder / "ca.crt", f"{folder / 'server.crt'},{folder / 'server.key'}"


def openssl(*arguments):
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def other_certificate(file, *options, key="ec"):
    """Self-signed, and its key, beside it as FILE.key."""
    kind = ["ec", "-pkeyopt", "ec_paramgen_curve:P-256"] if key == "ec" else [key]
    openssl("req", "-x509", "-newkey", *kind, "-noenc", "-keyout", f"{file}.key", "-out", file, "-subj", "/CN=other", *options)


def trusting_home(folder, authority):
    """A home whose Chromium trusts this authority."""
    store = folder / "home" / ".pki" / "nssdb"
    store.mkdir(parents=True)
    subprocess.run(["certutil", "-N", "-d", f"sql:{store}", "--empty-password"], check=True)
    subprocess.run(["certutil", "-A", "-d", f"sql:{store}", "-t", "C,,", "-n", "tenon-lab", "-i", authority], check=True)
    return str(folder / "home")


class Certificates(unittest.TestCase):
    def test_one_authority_signs_for_all_machines_and_keys_are_for_their_user_alone(self):
        with Stage() as stage:
            folder = stage.out / "tls"
            authority, _ = certificates(folder, "lab-pc.local", "192.168.7.5", "fd00::5")
            first = authority.read_bytes()
            openssl("verify", "-CAfile", authority, "-verify_hostname", "lab-pc.local", folder / "server.crt")
            for address in ("192.168.7.5", "fd00::5", "127.0.0.1"):
                openssl("verify", "-CAfile", authority, "-verify_ip", address, folder / "server.crt")
            with self.assertRaises(subprocess.CalledProcessError):
                openssl("verify", "-CAfile", authority, "-verify_hostname", "other.local", folder / "server.crt")
            certificates(folder)  # for this machine's own names
            self.assertEqual(authority.read_bytes(), first, "who trusts it need not do so again")
            openssl("verify", "-CAfile", authority, "-verify_hostname", os.uname().nodename, folder / "server.crt")
            for name in ("ca.key", "server.key"):
                self.assertEqual(stat.S_IMODE((folder / name).stat().st_mode), 0o600, name)
            for wrong in ("two words", "-x", "a,DNS:b", "a\nb"):
                self.assertEqual(tenon("cert", "--out", folder, wrong).returncode, 2, wrong)
            (folder / "ca.key").unlink()
            lost = tenon("cert", "--out", folder)
            self.assertEqual(lost.returncode, 1)
            self.assertIn("ca.crt is there, its key ca.key is not", lost.stderr)

    def test_what_cannot_be_used_is_said(self):
        with Stage() as stage:
            out = stage.out
            _, pair = certificates(out)
            good, key = pair.split(",")
            text, private = out / "text", out / "private"
            text.write_text("no certificate\n", encoding="utf-8")
            other_certificate(out / "other")
            other_certificate(out / "rsa", key="rsa:2048")
            other_certificate(out / "weak", key="rsa:1024")
            openssl("pkey", "-in", key, "-aes256", "-passout", "pass:secret", "-out", out / "locked")
            private.write_bytes(b"x")
            private.chmod(0)
            cases = [
                ((out / "none.crt", key), r"none\.crt: No such file or directory; `tenon cert` makes"),
                ((good, out / "none.key"), r"none\.key: No such file or directory; `tenon cert` makes"),
                ((out, key), r": is a folder"),
                ((text, key), r"text: is no certificate in PEM form"),
                ((good, text), r"text: is no private key in PEM form"),
                ((key, good), r"server\.key: is no certificate in PEM form"),
                ((good, out / "other.key"), r"other\.key: is not the key of the certificate .*server\.crt"),
                ((good, out / "rsa.key"), r"rsa\.key: is not the key of the certificate .*server\.crt"),
                ((good, out / "locked"), r"locked: the key has a passphrase"),
                ((out / "weak", out / "weak.key"), r"weak: the certificate cannot be used: "),
            ]
            if os.getuid() != 0:  # root reads all
                cases.append(((private, key), r"private: Permission denied$"))
            for (certificate, its_key), words in cases:
                with self.subTest(words=words):
                    done = tenon("console", "--domain", stage.domain, "--port", 0, "--tls", f"{certificate},{its_key}", timeout=60)
                    self.assertEqual(done.returncode, 1)
                    self.assertRegex(done.stderr, "^tenon-console: .*" + words)
                    self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            for arguments in (["--tls", good], ["--tls", pair, "--without-tls"]):
                self.assertEqual(tenon("console", "--port", 0, *arguments, timeout=60).returncode, 2, arguments)

    def test_a_certificate_outside_of_its_time_is_refused(self):
        with Stage() as stage:
            for name, days, words in (("old", ("20200101000000Z", "20210101000000Z"), r"has expired on Jan  1 00:00:00 2021 GMT; `tenon cert` makes a new one"),
                                      ("early", ("20980101000000Z", "20990101000000Z"), r"is not valid before Jan  1 00:00:00 2098 GMT; is this machine's clock right\?")):
                folder = stage.out / name
                folder.mkdir()
                (folder / "index").touch()
                (folder / "configuration").write_text(f"[ca]\ndefault_ca=d\n[d]\ndatabase={folder}/index\nnew_certs_dir={folder}\nserial={folder}/serial\n"
                                                      "default_md=sha256\npolicy=p\n[p]\ncommonName=supplied\n", encoding="utf-8")
                openssl("req", "-new", "-newkey", "rsa:2048", "-noenc", "-keyout", folder / "key", "-out", folder / "request", "-subj", "/CN=localhost")
                openssl("ca", "-config", folder / "configuration", "-batch", "-create_serial", "-selfsign", "-keyfile", folder / "key", "-in", folder / "request",
                        "-out", folder / "crt", "-startdate", days[0], "-enddate", days[1])
                done = tenon("console", "--port", 0, "--tls", f"{folder / 'crt'},{folder / 'key'}", timeout=60)
                self.assertEqual(done.returncode, 1)
                self.assertRegex(done.stderr, words)


class Tls(unittest.TestCase):
    def test_other_machines_are_served_with_a_certificate_alone(self):
        with Stage() as stage:
            for address, words in (("0.0.0.0", r"other machines reach it, so it needs a certificate: `tenon cert` makes one, --tls CERT,KEY names it\. --without-tls"),
                                   ("::", "other machines reach it"), ("lab-pc", "is no address of an interface")):
                done = tenon("console", "--domain", stage.domain, "--port", 0, "--listen", address, timeout=60)
                self.assertEqual(done.returncode, 1)
                self.assertRegex(done.stderr, words)
            # whoever wants it otherwise has chosen so: it answers to addresses and to this machine's name, which nobody else's DNS points here
            console, port = start_console(stage, 0, "--listen", "0.0.0.0", "--without-tls")
            self.assertIn(f"console: http://{os.uname().nodename}:{port}/", console.text())
            for host, permitted in (("localhost", True), ("192.168.7.5", True), ("[fd00::5]", True), (os.uname().nodename, True), ("evil.example", False)):
                self.assertEqual(get(port, "/", host=f"{host}:{port}")[0] != 403, permitted, host)

    def test_https_and_wss_with_the_labs_authority(self):
        with Stage() as stage:
            authority, pair = certificates(stage.out, "lab-pc.local", "192.168.7.5")
            console, port = start_console(stage, 0, "--listen", "0.0.0.0", "--tls", pair, "--role", "instructor")
            self.assertIn(f"console: https://lab-pc.local:{port}/", console.text())
            tls = ssl.create_default_context(cafile=authority)
            status, answer = get(port, "/", tls=tls)
            self.assertIn(status, (200, 503))
            self.assertIn(b"default-src 'none'", answer)
            for host, permitted in ((f"lab-pc.local:{port}", True), ("192.168.7.5", True), ("evil.example", False), ("192.168.7.6", False)):
                self.assertEqual(get(port, "/", host=host, tls=tls)[0] != 403, permitted, host)
            with self.assertRaises(ssl.SSLCertVerificationError):
                get(port, "/", tls=ssl.create_default_context())
            # from TLS 1.2 on
            for version, works in ((ssl.TLSVersion.TLSv1_1, False), (ssl.TLSVersion.TLSv1_2, True), (ssl.TLSVersion.TLSv1_3, True)):
                one = ssl.create_default_context(cafile=authority)
                one.set_ciphers("DEFAULT:@SECLEVEL=0")
                one.minimum_version = one.maximum_version = version
                if works:
                    self.assertIn(get(port, "/", tls=one)[0], (200, 503))
                else:
                    with self.assertRaises((ssl.SSLError, ConnectionError)):
                        get(port, "/", tls=one)

            stage.serve(SCENARIO, "--wait-for", "right")
            console.wait_for("joined session 'test'")
            with Viewer(port, origin=f"https://localhost:{port}", tls=tls) as desk:
                desk.begin("/console")
                self.assertTrue(desk.ask("deskSit", role="instructor", name="Ada", key=pass_of(console))["accepted"])
            with self.assertRaises(Refused) as refused:
                Viewer(port, origin=f"http://localhost:{port}", tls=tls)
            self.assertEqual(refused.exception.status, 403, "a page that came in plain")

            # plain HTTP is sent to https, and nothing else of it is answered
            status, answer = get(port, "/?session=test")
            self.assertEqual(status, 308)
            self.assertIn(f"Location: https://localhost:{port}/?session=test\r\n".encode(), answer)
            self.assertEqual(get(port, "/", host="evil.example")[0], 403)
            with self.assertRaises(Refused) as refused:
                Viewer(port)
            self.assertEqual(refused.exception.status, 400)

    def test_slow_handshakes_and_garbage_cost_nobody_anything(self):
        with Stage() as stage:
            authority, pair = certificates(stage.out)
            console, port = start_console(stage, 0, "--tls", pair)
            tls = ssl.create_default_context(cafile=authority)
            with Viewer(port, tls=tls) as viewer:
                viewer.begin("/console")
                before = memory(console)
                hello = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"
                idle = []
                for i in range(300):  # nothing, a bit of a handshake, and more of one
                    idle.append(socket.create_connection(("127.0.0.1", port)))
                    idle[-1].sendall(hello[:[0, 3, len(hello)][i % 3]])
                began = time.monotonic()
                for garbage in (b"\0\1\2garbage\r\n\r\n", b"\x16\x03\x01\xff\xff" + os.urandom(70000), b"\x16\x03\x01\x00\x05\x01\x00\x00\x01\x00", os.urandom(1000)):
                    with connect(port) as connection:
                        connection.sendall(garbage)
                self.assertIn(get(port, "/", tls=tls)[0], (200, 503))
                self.assertIsNone(console.popen.poll())
                self.assertLess(memory(console) - before, 40, "MB")
                # they end: those that made room at once, the others after their time
                for connection in idle:
                    connection.settimeout(max(1, 60 - (time.monotonic() - began)))
                    try:
                        while connection.recv(4096):
                            pass
                    except ConnectionError:
                        pass
                    connection.close()
                self.assertEqual(json.loads(next(viewer.messages())[1])["state"], "searching")


@unittest.skipUnless(shutil.which("chromium") and shutil.which("certutil") and (TOOLS / "node_modules").exists(),
                     "no chromium, no certutil or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class Page(unittest.TestCase):
    def test_a_browser_that_trusts_the_authority_shows_the_session(self):
        with Stage() as stage:
            authority, pair = certificates(stage.out)
            server = stage.serve(SCENARIO, "--wait-for", "right")
            console, port = start_console(stage, 0, "--tls", pair, "--role", "instructor")
            console.wait_for("joined session 'test'")
            with Browser(HOME=trusting_home(stage.out, authority)) as browser:
                browser("open", url=f"https://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
                browser("await", expression="document.querySelector('.top .badge').textContent === 'Live' && tenon.view.models >= 3")
                self.assertTrue(browser("value", expression="isSecureContext && location.protocol === 'https:'"))
                browser("await", expression="document.querySelector('.desk')?.hidden === false")
                stage.start("trainee", "--seed", 1)
                browser("await", expression="tenon.session.tick > 0")
                browser("value", expression="document.querySelector('[data-command=pause]').click()")
                browser("await", expression="tenon.session.run.phase === 2")
                self.assertEqual(browser.problems, [])
            self.assertIsNone(server.popen.poll())
            with Browser(HOME=str(stage.out)) as stranger, self.assertRaisesRegex(AssertionError, "ERR_CERT_AUTHORITY_INVALID"):
                stranger("open", url=f"https://localhost:{port}/", width=1280, height=800, theme="light")


if __name__ == "__main__":
    unittest.main()
