"""New entries of the worklist are sent once to a mail server and a webhook, with what to inspect first."""

import email
import email.policy
import json
import socketserver
import threading
from dataclasses import replace
from datetime import datetime
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from turnout.cli.main import main
from turnout.cli.worklist import as_text
from turnout.config import load_configuration
from turnout.config.settings.alerts import AlertsSettings
from turnout.errors import TurnoutError
from turnout.workflow.alerts import has_channel, message_text, send_alerts, subject

ALARM = {
    "turnout_id": "W1", "sections": "A8", "band": "ballast", "source": "hammer", "state": "inspect this week",
    "raised_at_utc": datetime(2026, 3, 1), "name": "Köln, Weiche 1", "sentence": "Lost 4 % since January",
    "look_at": "voids and wet or fouled ballast under these sleepers",
}  # fmt: skip
PLAN = ALARM | {
    "turnout_id": "W2",
    "state": "plan",
    "raised_at_utc": None,
    "look_at": "worn, cracked or displaced pads",
}


class SmtpSink(socketserver.StreamRequestHandler):
    """The part of RFC 5321 that a client needs to send one mail."""

    def handle(self):
        self.wfile.write(b"220 sink\r\n")
        while line := self.rfile.readline():
            verb = line[:4].upper()
            if verb == b"DATA":
                self.wfile.write(b"354 go on\r\n")
                lines = iter(self.rfile.readline, b".\r\n")
                self.server.mails.append(b"".join(lines))
            self.wfile.write(b"221 bye\r\n" if verb == b"QUIT" else b"250 ok\r\n")
            if verb == b"QUIT":
                return


class HttpSink(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.bodies.append(json.loads(body))
        self.send_response(self.server.status)
        self.end_headers()

    def log_message(self, *words):
        pass


@pytest.fixture
def serving():
    """Function that starts a server in a thread and returns it; all servers stop after the test."""
    servers = []

    def start(server):
        servers.append(server)
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        return server

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.fixture
def mail(serving):
    server = serving(socketserver.ThreadingTCPServer(("127.0.0.1", 0), SmtpSink))
    server.mails = []
    return server


@pytest.fixture
def hook(serving):
    server = serving(HTTPServer(("127.0.0.1", 0), HttpSink))
    server.bodies, server.status = [], 200
    return server


@pytest.fixture
def settings(mail, hook, monkeypatch):
    monkeypatch.delenv("TURNOUT_WEBHOOK", raising=False)
    return AlertsSettings(
        recipients="track@example.org, deputy@example.org", sender="turnout@example.org", smtp_host="127.0.0.1",
        smtp_port=mail.server_address[1], webhook=f"http://127.0.0.1:{hook.server_address[1]}/", timeout=5.0,
    )  # fmt: skip


def test_each_entry_is_sent_once_by_each_channel(tmp_path, settings, mail, hook):
    sent = tmp_path / "alerts.json"
    assert send_alerts([ALARM], settings, sent) == {"mail": 1, "webhook": 1}
    assert send_alerts([ALARM], settings, sent) == {"mail": 0, "webhook": 0}
    assert send_alerts([ALARM, PLAN], settings, sent) == {"mail": 1, "webhook": 1}
    assert len(mail.mails) == len(hook.bodies) == 2
    first = email.message_from_bytes(mail.mails[0], policy=email.policy.default)
    assert (first["From"], first["To"]) == ("turnout@example.org", "track@example.org, deputy@example.org")
    assert first["Subject"] == "Turnout: 1 new entry: W1 A8"
    text = first.get_content().replace("\r\n", "\n")
    assert text == message_text([ALARM])
    assert "INSPECT THIS WEEK: W1 (Köln, Weiche 1), A8, ballast\nLost 4 % since January\n" in text
    assert "Look first at: voids and wet or fouled ballast under these sleepers." in text
    (second,) = hook.bodies[1]["entries"]
    assert second["turnout_id"] == "W2" and second["look_at"] in hook.bodies[1]["text"]


def test_an_entry_without_an_alarm_that_comes_back_is_sent_again(tmp_path, settings, mail):
    """Another campaign to be confirmed is one. An alarm that was off the list, as while suppressed, is not."""
    sent = tmp_path / "alerts.json"
    confirm = PLAN | {"state": "confirm now"}
    assert send_alerts([ALARM, confirm], settings, sent) == {"mail": 2, "webhook": 2}
    assert send_alerts([ALARM, confirm], settings, sent) == {"mail": 0, "webhook": 0}
    assert send_alerts([], settings, sent) == {"mail": 0, "webhook": 0}
    assert send_alerts([ALARM, confirm], settings, sent) == {"mail": 1, "webhook": 1}


def test_an_entry_that_left_the_list_while_a_server_failed_is_sent_when_it_comes_back(tmp_path, settings, mail):
    """That night had another entry to send; what had left the list is noted whether or not the server answers."""
    sent, without_server = tmp_path / "alerts.json", replace(settings, smtp_host="")
    confirm, other = PLAN | {"state": "confirm now"}, PLAN | {"turnout_id": "W7"}
    assert send_alerts([ALARM, confirm], settings, sent)["mail"] == 2
    with pytest.raises(TurnoutError, match="smtp_host is empty"):
        send_alerts([ALARM, other], without_server, sent)
    assert send_alerts([ALARM, confirm, other], settings, sent)["mail"] == 2


def test_an_entry_beyond_the_limit_of_the_list_is_still_on_it(tmp_path, settings, mail):
    sent = tmp_path / "alerts.json"
    send_alerts([ALARM, PLAN], settings, sent)
    send_alerts([ALARM], settings, sent, listed=[ALARM, PLAN])
    assert send_alerts([ALARM, PLAN], settings, sent) == {"mail": 0, "webhook": 0}


@pytest.mark.parametrize("content", ["[1]", '"a"', "null", '{"mail": null}', '{"mail": 7, "webhook": [1]}', "{"])
def test_a_damaged_note_of_what_was_sent_sends_the_entries_again(tmp_path, settings, mail, content):
    sent = tmp_path / "alerts.json"
    sent.write_text(content)
    assert send_alerts([ALARM], settings, sent) == {"mail": 1, "webhook": 1}
    assert send_alerts([ALARM], settings, sent) == {"mail": 0, "webhook": 0}


def test_recipients_without_a_mail_server_are_an_error_that_says_what_to_write(tmp_path, settings):
    with pytest.raises(TurnoutError, match=r"smtp_host is empty\. Write the name of the mail server"):
        send_alerts([ALARM], replace(settings, smtp_host=""), tmp_path / "alerts.json")


def test_an_acknowledged_alarm_is_no_new_entry(tmp_path, settings, mail):
    sent = tmp_path / "alerts.json"
    send_alerts([ALARM], settings, sent)
    assert send_alerts([ALARM | {"state": "plan"}], settings, sent) == {"mail": 0, "webhook": 0}
    later = ALARM | {"raised_at_utc": datetime(2026, 5, 1)}
    assert send_alerts([later], settings, sent) == {"mail": 1, "webhook": 1}


def test_only_the_channel_that_failed_sends_again(tmp_path, settings, mail, hook):
    sent = tmp_path / "alerts.json"
    hook.status = 503
    with pytest.raises(TurnoutError, match=r"not sent by webhook \(127.0.0.1\): HTTP Error 503.*tried again"):
        send_alerts([ALARM], settings, sent)
    hook.status = 200
    assert send_alerts([ALARM], settings, sent) == {"mail": 0, "webhook": 1}
    assert len(mail.mails) == 1


@pytest.mark.parametrize("change", [{"smtp_port": 9}, {"smtp_host": "no.such.host.invalid"}])
def test_an_unreachable_mail_server_is_reported(tmp_path, settings, hook, change):
    with pytest.raises(TurnoutError, match=r"not sent by mail \(.*, port .*section alerts of config.yaml") as raised:
        send_alerts([ALARM], replace(settings, **change), tmp_path / "alerts.json")
    assert all(str(value) in str(raised.value) for value in change.values()) and "Errno" not in str(raised.value)
    assert len(hook.bodies) == 1


def test_an_environment_variable_overrides_the_webhook(tmp_path, settings, hook, monkeypatch):
    monkeypatch.setenv("TURNOUT_WEBHOOK", settings.webhook)
    own = AlertsSettings(webhook="http://127.0.0.1:9/")
    assert send_alerts([ALARM], own, tmp_path / "alerts.json") == {"webhook": 1} and len(hook.bodies) == 1


def test_a_webhook_that_is_no_web_address_is_rejected(tmp_path, monkeypatch):
    monkeypatch.delenv("TURNOUT_WEBHOOK", raising=False)
    with pytest.raises(TurnoutError, match="begins neither with https"):
        send_alerts([ALARM], AlertsSettings(webhook="file:///etc/hostname"), tmp_path / "alerts.json")


@pytest.mark.parametrize("recipients", ["a@b.c; d@e.f", "a@b.c d@e.f", "a@b.c, <d@e.f"])
def test_an_invalid_list_of_recipients_is_an_error(tmp_path, settings, mail, recipients):
    with pytest.raises(TurnoutError, match=r"is no mail address. Write name@host, several with commas between"):
        send_alerts([ALARM], replace(settings, recipients=recipients, webhook=""), tmp_path / "alerts.json")
    assert not mail.mails


@pytest.mark.parametrize("recipients", ["a@b.c, Track team <d@e.f>", "root"])
def test_recipients_may_have_names_or_be_local_users(tmp_path, settings, mail, recipients):
    assert send_alerts([ALARM], replace(settings, recipients=recipients), tmp_path / "alerts.json")["mail"] == 1


@pytest.mark.parametrize("chart, words", [("ballast_damping", "ballast damping"), ("amplitude", "acceleration")])
def test_worklist_and_message_name_a_chart_in_plain_words(chart, words):
    """The page of the fleet uses the same words."""
    entry = ALARM | {"band": chart, "component": chart, "rank": 1, "n_in_all": 1, "false_alarm_words": "rare"}
    texts = message_text([entry]), as_text([entry | {"last_maintenance": None}], 1)
    assert all(f"A8, {words}\n" in text and chart not in text for text in texts)


def test_the_subject_contains_three_entries_and_the_number_of_others():
    entries = [ALARM | {"turnout_id": f"W{k}"} for k in range(5)]
    assert subject(entries) == "Turnout: 5 new entries: W0 A8, W1 A8, W2 A8 and 2 more"


def test_without_recipients_nothing_is_sent_and_the_settings_change_no_hash(tmp_path, repository, monkeypatch, capsys):
    monkeypatch.delenv("TURNOUT_WEBHOOK", raising=False)
    assert not has_channel(AlertsSettings()) and send_alerts([ALARM], AlertsSettings(), tmp_path / "a.json") == {}
    (tmp_path / "config").mkdir()
    for name in ("turnouts.tsv", "layouts"):
        (tmp_path / "config" / name).symlink_to(repository / "config" / name)
    hashes = set()
    for text in ("", "alerts: {recipients: a@b.c}\n"):
        (tmp_path / "config/config.yaml").write_text(text)
        hashes.add(load_configuration(tmp_path / "config").turnout("tommerup_s1").config_hash)
    assert len(hashes) == 1


def test_the_command_reads_the_worklist_of_a_registry(tmp_path, repository, monkeypatch, capsys, settings):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("turnout.workflow.alerts.worklist_entries", lambda registry, beyond_limit=False: [ALARM])
    (tmp_path / "config").mkdir()
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\n")
    (tmp_path / "config/config.yaml").write_text("")
    assert main(["alert"]) == 2
    assert "neither recipients nor webhook" in capsys.readouterr().err
    (tmp_path / "config/config.yaml").write_text(f"alerts: {{webhook: '{settings.webhook}'}}\n")
    assert main(["alert", "--dry-run"]) == 0 and "Look first at: voids" in capsys.readouterr().out
    assert main(["alert"]) == 0 and capsys.readouterr().out == "webhook: 1 new\n"
    assert main(["alert"]) == 0 and capsys.readouterr().out == "webhook: 0 new\n"


def test_every_state_of_the_worklist_that_needs_action_is_sent():
    from turnout.report.pages import fleet
    from turnout.workflow.alerts import STATES

    without_work = ("learning", "not measured", "suppressed", "ok")
    assert STATES == tuple(state for state in fleet.STATES if state not in without_work)
