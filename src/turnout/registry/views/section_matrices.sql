-- One row per section, campaign and resonance: the model as in Tables 1 and 2 of the paper, with standard errors.
-- needs: modes_current, models_current
create or replace view section_matrices as
select
    m.section_id, m.turnout_id, k.campaign_id, m.measured_at_utc, m.band, m.method,
    m.a_block[1] as a11, m.a_block_se[1] as a11_se, m.a_block[2] as a12, m.a_block_se[2] as a12_se,
    m.a_block[3] as a21, m.a_block_se[3] as a21_se, m.a_block[4] as a22, m.a_block_se[4] as a22_se,
    m.c_block[1] as c1, m.c_block_se[1] as c1_se, m.c_block[2] as c2, m.c_block_se[2] as c2_se,
    m.n_impacts, k.sampling_rate_hz, m.model_id
from modes_current m join models_current k on m.model_id = k.model_id
where m.a_block is not null and m.source = 'hammer'
order by m.section_id, m.measured_at_utc, m.band;

-- columns of section_matrices
-- section_id | varchar | | section
-- turnout_id | varchar | | turnout
-- campaign_id | varchar | | campaign
-- measured_at_utc | timestamp | UTC | time of the campaign
-- band | varchar | | which resonance: ballast is Table 1 of the paper, railpad Table 2
-- method | varchar | | method of its model
-- a11 | double | | entry a11 of the model in balanced form
-- a11_se | double | | standard error of a11
-- a12 | double | | entry a12 of the model in balanced form
-- a12_se | double | | standard error of a12
-- a21 | double | | entry a21 of the model in balanced form
-- a21_se | double | | standard error of a21
-- a22 | double | | entry a22 of the model in balanced form
-- a22_se | double | | standard error of a22
-- c1 | double | | entry c1 of the model in balanced form
-- c1_se | double | | standard error of c1
-- c2 | double | | entry c2 of the model in balanced form
-- c2_se | double | | standard error of c2
-- n_impacts | integer | | impacts behind the values
-- sampling_rate_hz | double | Hz | rate of the state-space model
-- model_id | varchar | | model
