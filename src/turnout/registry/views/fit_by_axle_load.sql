-- One row per section and axle load class of 2.5 t: mean, spread and standard error of the scores, as in the paper's Table 4.
-- Train type, speed and axle load go together on a real line: a difference between classes is not yet their effect.
-- needs: fit_by_class
create or replace view fit_by_axle_load as
select turnout_id, section_id, class_from as axle_load_from_t, columns(* exclude (turnout_id, section_id, class_name, class_from))
from fit_by_class('axle_load');
