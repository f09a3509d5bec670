-- Words on the stiffness behind a change of a resonance: which component, by how much with its 95 % interval. It holds if
-- all supports around the section have changed alike; a diagnosis gives that of single sleepers, which change more.
-- Without a component (one resonance, or a list of an earlier day) the stiffness is about twice the change of frequency.
create or replace macro one_stiffness_words(component, pct, low_pct, high_pct) as (
    component || case when pct < 0 then ' lost ' else ' gained ' end
        || printf('%.0f %% of stiffness (%.0f to %.0f, 95 %%)', abs(pct),
            case when pct < 0 then -high_pct else low_pct end, case when pct < 0 then -low_pct else high_pct end)
);

create or replace macro stiffness_words(
    band, component, change_pct, ballast_pct, ballast_low_pct, ballast_high_pct, pad_pct, pad_low_pct, pad_high_pct
) as (
    case
        when band not in ('ballast', 'railpad') then ''
        when component in ('ballast', 'pad', 'both') then
            '; if all supports around the section have changed alike, ' || concat_ws(' and ',
                case when component <> 'pad' then
                    one_stiffness_words('the ballast', ballast_pct, ballast_low_pct, ballast_high_pct) end,
                case when component <> 'ballast' then
                    one_stiffness_words('the railpads', pad_pct, pad_low_pct, pad_high_pct) end)
        else printf('; the stiffness is about %.0f %% %s', abs((1 + change_pct / 100) ** 2 - 1) * 100,
                case when change_pct < 0 then 'lower' else 'higher' end)
            || case when component = 'either' then '; both resonances together do not decide between ballast and railpads'
                else '' end
    end
);

-- What to look at where the stiffness of the ballast, or of the railpads, has changed by pct, and at which sleepers.
create or replace macro ballast_advice(pct, sleepers) as (
    case when pct < 0 then 'voids and wet or fouled ballast under ' || coalesce(sleepers, 'these sleepers')
        else 'frost, or tamping that is not in the events' end
);

create or replace macro pad_advice(pct, sleepers) as (
    case when pct < 0 then 'worn, cracked or displaced pads, loose fastenings' || coalesce(' at ' || sleepers, '')
        else 'pads exchanged or hardened; an exchange that is not in the events' end
);

-- What to look at under a sleeper that hangs.
create or replace macro void_advice(sleepers) as (
    'the void under ' || sleepers || ': measure it with a void meter, or with a level while a train passes'
);

-- What of the running surface can be worn in a panel.
create or replace macro worn_parts(panel) as (
    case panel when 'CP' then ', a worn nose or wing rail' when 'SP' then ', a worn blade or stock rail' else '' end
);

-- What to look at where the peak acceleration under trains has changed: hammer tests that find the support unchanged
-- leave the running surface and the sensor; a fall is more often of the sensor. The range is that of the diagnoses.
create or replace macro peak_advice(direction, is_support_unchanged, panel, position_m) as (
    case
        when not coalesce(is_support_unchanged, false) then
            'running surface, fastenings and voids; the mounting of the sensor'
        when direction = 'down' then
            'the mounting and the calibration of the sensor; grinding or welding that is not in the events'
        else 'the running surface with a straightedge'
            || coalesce(printf(' from %.1f to %.1f m', position_m - 3, position_m + 3), '')
            || ': a dipped weld or joint' || worn_parts(panel) || ', corrugation; if it is smooth, the mounting of the sensor'
    end
);

-- For words: to a tenth, without the sign of a negative zero.
create or replace macro to_a_tenth(number) as (round(number, 1) + 0.0);

-- Two numbers in percent, one where both read alike; NULL without numbers.
create or replace macro one_or_range(low, high) as (
    case when printf('%.1f', low) = printf('%.1f', high) then printf('%.1f %%', low) else printf('%.1f to %.1f %%', low, high) end
);
