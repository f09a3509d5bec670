"""Settings of the alerts: where new entries of the worklist are sent."""

from dataclasses import dataclass

from turnout.config.settings.setting import MAIL_ADDRESSES, MAIL_SENDER, WEB_ADDRESS, setting


@dataclass(frozen=True)
class AlertsSettings:
    """Mail server and webhook that get new entries of the worklist; nothing is sent without them."""

    recipients: str = setting(
        "", why="addresses for the mail, separated by commas; empty: no mail", pattern=MAIL_ADDRESSES
    )
    sender: str = setting("", why="address that the mail comes from; empty: the first recipient", pattern=MAIL_SENDER)
    smtp_host: str = setting("localhost", why="mail server; the password of smtp_user is in TURNOUT_SMTP_PASSWORD")
    smtp_port: int = setting(25, why="25 without encryption, 587 for starttls, 465 for tls", minimum=1, maximum=65535)
    smtp_security: str = setting("none", why="encryption of the connection", choices=("none", "starttls", "tls"))
    smtp_user: str = setting("", why="user of the mail server; empty: no login")
    webhook: str = setting(
        "", why="URL that gets a JSON object; TURNOUT_WEBHOOK in the environment comes first", pattern=WEB_ADDRESS
    )
    timeout: float = setting(
        20.0, unit="s", why="a server that does not answer by then is tried the next night", minimum=0.1
    )
