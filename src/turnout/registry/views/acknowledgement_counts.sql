-- Whether an acknowledgement of a time counts on a day. On the newest day all count that were entered until the registry
-- was made. On an earlier day only those before it count, and a planned suppression has not started.
-- needs: chart_status_at
create or replace macro acknowledgement_counts(at_utc, "asof") as (
    at_utc <= "asof"
    or ("asof" >= newest_charted() and at_utc < greatest("asof", published_at()) + interval 1 day)
);
