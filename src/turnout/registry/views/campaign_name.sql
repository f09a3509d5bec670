-- The campaign of a turnout that began at a time, as its folder and campaigns.csv name it: by the local day, which may be
-- the day after that of its start in UTC. Where no hammer test began then, as for weekly values of trains, the day in UTC.
-- needs: models_current
create or replace macro campaign_name(of_turnout, began_at) as (
    coalesce(
        (
            select min(split_part(campaign_id, '/', -1)) from models_current
            where turnout_id = of_turnout and measured_at_utc = began_at
        ),
        strftime(began_at, '%Y-%m-%d')
    )
);
