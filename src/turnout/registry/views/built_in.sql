-- Two views have no statement here: the program makes them with the values of the registry. Their columns:

-- columns of reasons
-- reason_code | varchar | | code of a rejection or a quarantine row
-- meaning | varchar | | what it means
-- is_remark | boolean | | whether recordings with it are used all the same

-- columns of registry_info
-- generation | bigint | | number of the last commit
-- folder | varchar | | folder that the views read from
-- newest_measurement_at_utc | timestamp | UTC | time of the newest measurement
-- n_files | bigint | | live Parquet files
-- n_bytes | bigint | byte | their size
-- views_version | varchar | | hash of the views and descriptions in this file
