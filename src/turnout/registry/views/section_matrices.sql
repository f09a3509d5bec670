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
