"""Alerts: new entries of the worklist by mail and webhook, each once, with what to look at first.

What was sent is noted per channel in ``work/alerts.json``. A channel that fails keeps its entries for the next run.
"""

from __future__ import annotations

import json
import os
import re
import smtplib
import ssl
import urllib.error
import urllib.parse
import urllib.request
from email.message import EmailMessage
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.counts import first_texts
from turnout.errors import TurnoutError
from turnout.files import read_json, write_text
from turnout.registry.as_of import chart_in_words, list_day, whole_list
from turnout.registry.database import open_registry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from turnout.config.settings.alerts import AlertsSettings
from turnout.config.settings.setting import MAIL_ADDRESS, WEB_ADDRESS

SENT_FILE = Path("work/alerts.json")
STATES = ("confirm now", "inspect this week", "plan", "cannot tell")  # a chart that learns needs nobody
MAX_NAMED = 3  # entries named in the subject
PASSWORD, WEBHOOK = "TURNOUT_SMTP_PASSWORD", "TURNOUT_WEBHOOK"  # of the environment


def worklist_entries(registry: Path | str, beyond_limit: bool = False) -> list[dict[str, Any]]:
    """Entries of today's worklist that need a person.

    Parameters
    ----------
    registry : path
        Folder of the registry.
    beyond_limit : bool
        Whether rows beyond the limit of the list are included.

    Returns
    -------
    list of dict
        Rows of the view ``worklist``, the most urgent first.
    """
    with open_registry(registry) as con:
        day = list_day(con)
        rows_of = whole_list(day) if beyond_limit else f"worklist({day})"
        cursor = con.execute(f"select * from {rows_of} order by rank")
        names = [column[0] for column in cursor.description]
        rows = [dict(zip(names, row)) for row in cursor.fetchall()]
    return [row for row in rows if row["state"] in STATES]


def send_new_entries(registry: Path | str, settings: AlertsSettings) -> dict[str, int]:
    """Send the entries of today's worklist that a channel has not got yet.

    Parameters
    ----------
    registry : path
        Folder of the registry.
    settings : AlertsSettings
        Section ``alerts`` of the configuration.

    Returns
    -------
    dict of str to int
        As ``send_alerts``.

    Raises
    ------
    TurnoutError
        As ``send_alerts``.
    """
    return send_alerts(worklist_entries(registry), settings, listed=worklist_entries(registry, beyond_limit=True))


def send_alerts(
    entries: Sequence[Mapping[str, Any]],
    settings: AlertsSettings,
    sent_file: Path = SENT_FILE,
    listed: Sequence[Mapping[str, Any]] | None = None,
) -> dict[str, int]:
    """Send the entries that a channel has not got yet.

    An alarm is one entry in whatever state, identified by the campaign that raised it. An entry without an alarm is one
    as long as it is on the list: one that comes back is new, as another campaign to be confirmed.

    Parameters
    ----------
    entries : sequence of mapping
        Rows of the view ``worklist``.
    settings : AlertsSettings
        Section ``alerts`` of the configuration.
    sent_file : Path
        Note of what was sent.
    listed : sequence of mapping or None
        Rows of the list without its limit; None: ``entries`` are all.

    Returns
    -------
    dict of str to int
        Number of new entries by channel, "mail" and "webhook"; empty if no channel is configured.

    Raises
    ------
    TurnoutError
        If a server cannot be reached or rejects the message. Other channels have got theirs by then.
    """
    sent: dict[str, list[str]] = read_json(sent_file, {})
    counts, errors = {}, []
    present = {_key(entry) for entry in (*entries, *(listed or ()))}
    for channel, send in _channels(settings).items():
        sent_keys = _sent_keys(sent.get(channel))
        known = {key for key in sent_keys if key in present or not key.endswith(STATES)}
        new = [entry for entry in entries if _key(entry) not in known]
        counts[channel] = len(new)
        try:
            if new:
                send(new, settings)
            known |= {_key(entry) for entry in new}
        except (OSError, smtplib.SMTPException, urllib.error.URLError, ValueError) as error:
            errors.append(f"{_address(channel, settings)}: {_reason(error)}")
        if known != sent_keys:
            sent[channel] = sorted(known)
            write_text(sent_file, json.dumps(sent, indent=1) + "\n")
    if errors:
        remedy = "Check the section alerts of config.yaml and the server; they are tried again in the next run"
        raise TurnoutError(f"alerts were not sent by {'; '.join(errors)}. {remedy}.")
    return counts


def _sent_keys(keys: Any) -> set[str]:
    """Keys of the entries that a channel has got, from the note of what was sent."""
    return set(map(str, keys)) if isinstance(keys, list) else set()


def has_channel(settings: AlertsSettings) -> bool:
    """Whether a mail address or a webhook is configured.

    Parameters
    ----------
    settings : AlertsSettings
        Section ``alerts`` of the configuration.

    Returns
    -------
    bool
        False where nothing would be sent.
    """
    return bool(_channels(settings))


def _channels(settings: AlertsSettings) -> dict[str, Callable[[Sequence[Mapping[str, Any]], AlertsSettings], None]]:
    """The configured channels and their functions."""
    channels: dict[str, Callable[[Sequence[Mapping[str, Any]], AlertsSettings], None]] = {}
    if settings.recipients:
        channels["mail"] = _send_mail
    if _webhook(settings):
        channels["webhook"] = _post
    return channels


def _webhook(settings: AlertsSettings) -> str:
    return os.environ.get(WEBHOOK) or settings.webhook


def _address(channel: str, settings: AlertsSettings) -> str:
    """A channel with its server, for messages. The address of a webhook may be a secret: only its host is named."""
    if channel == "mail":
        return f"mail ({settings.smtp_host}, port {settings.smtp_port})"
    host = urllib.parse.urlsplit(_webhook(settings)).hostname
    return f"webhook ({host})" if host else "webhook"


def _reason(error: Exception) -> str:
    """An error in words, without brackets and the number of the operating system."""
    if isinstance(error, smtplib.SMTPResponseException):
        text = error.smtp_error
        return f"{error.smtp_code} {text.decode('utf-8', 'replace') if isinstance(text, bytes) else text}"
    if isinstance(error, (urllib.error.HTTPError, smtplib.SMTPException)):
        return str(error)
    cause = error.reason if isinstance(error, urllib.error.URLError) else error
    return str(cause.strerror if isinstance(cause, OSError) and cause.strerror else cause)


def _key(entry: Mapping[str, Any]) -> str:
    """An alarm is one entry in whatever state; without an alarm each state is one."""
    stage = entry["raised_at_utc"] or entry["state"]
    return " ".join(str(entry[name]) for name in ("turnout_id", "sections", "band", "source")) + f" {stage}"


def subject(entries: Sequence[Mapping[str, Any]]) -> str:
    """Title of a message.

    Parameters
    ----------
    entries : sequence of mapping
        New rows of the view ``worklist``.

    Returns
    -------
    str
        One line.
    """
    named = first_texts([f"{entry['turnout_id']} {entry['sections']}" for entry in entries], MAX_NAMED)
    return f"Turnout: {len(entries)} new {'entry' if len(entries) == 1 else 'entries'}: {named}"


def message_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """Text of a message: a paragraph per entry, with what to look at first.

    Parameters
    ----------
    entries : sequence of mapping
        New rows of the view ``worklist``.

    Returns
    -------
    str
        Several lines.
    """
    paragraphs = []
    for entry in entries:
        name = f" ({entry['name']})" if entry["name"] else ""
        component = chart_in_words(entry.get("component") or entry["band"])
        paragraphs.append(
            f"{entry['state'].upper()}: {entry['turnout_id']}{name}, {entry['sections']}, {component}\n"
            f"{entry['sentence']}\nLook first at: {entry['look_at']}."
        )
    return "\n\n".join(paragraphs) + "\n"


def _send_mail(entries: Sequence[Mapping[str, Any]], settings: AlertsSettings) -> None:
    recipients = [address.strip() for address in settings.recipients.split(",") if address.strip()]
    for address in (*recipients, *filter(None, [settings.sender])):
        if not re.fullmatch(MAIL_ADDRESS, address):
            raise ValueError(f"{address!r} is no mail address. Write name@host, several with commas between")
    message = EmailMessage()
    message["Subject"], message["From"] = subject(entries), settings.sender or recipients[0]
    message["To"] = ", ".join(recipients)
    message.set_content(message_text(entries))
    host, port, timeout = settings.smtp_host, settings.smtp_port, settings.timeout
    if not host:  # smtplib would not connect, and ask for that
        raise ValueError("smtp_host is empty. Write the name of the mail server")
    context = ssl.create_default_context()
    if settings.smtp_security == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(host, port, timeout=timeout, context=context)
    else:
        server = smtplib.SMTP(host, port, timeout=timeout)
    with server:
        if settings.smtp_security == "starttls":
            server.starttls(context=context)
        if settings.smtp_user:
            server.login(settings.smtp_user, os.environ.get(PASSWORD, ""))
        server.send_message(message)


def _post(entries: Sequence[Mapping[str, Any]], settings: AlertsSettings) -> None:
    """One JSON object: ``text`` for chat programs, ``entries`` for others."""
    content = {"text": f"{subject(entries)}\n\n{message_text(entries)}", "entries": [dict(e) for e in entries]}
    url = _webhook(settings)
    if not re.fullmatch(WEB_ADDRESS, url):
        raise ValueError("the address begins neither with https:// nor with http://")
    body = json.dumps(content, default=str, ensure_ascii=False).encode()
    request = urllib.request.Request(url, body, {"Content-Type": "application/json; charset=utf-8"})
    urllib.request.urlopen(request, timeout=settings.timeout).close()
