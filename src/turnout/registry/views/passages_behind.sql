-- One row per passage and sensor behind a number: those of one section from one time up to, not including, another.
-- needs: passage_scores
create or replace macro passages_behind(section, from_utc, to_utc) as table
select s.*, r.path, r.recording_id
from passage_scores s join passages_current p on s.passage_id = p.passage_id
    left join recordings r on r.recording_id = p.recording_id and r.result_id = p.result_id
where s.section_id = section and s.passed_at_utc >= from_utc::timestamp and s.passed_at_utc < to_utc::timestamp
order by s.passed_at_utc, s.channel;
