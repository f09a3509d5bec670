-- Whether what somebody said at a time counts on a day: on the newest one all that was said until the registry was made.
-- Nobody has seen what has not happened yet, and a planned suppression has not started.
-- needs: chart_status_at
create or replace macro was_said(at_utc, "asof") as (
    at_utc <= "asof"
    or ("asof" >= newest_charted() and at_utc < greatest("asof", published_at()) + interval 1 day)
);
