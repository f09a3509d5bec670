"""Names of metadata that loggers use in European languages: in lower case, without accents, with "_" between words."""

START_NAMES = (
    "started_at", "start_time", "starttime", "wf_start_time", "startzeit", "startzeitpunkt", "messbeginn", "messstart",
    "beginn_der_messung", "heure_de_debut", "debut_de_mesure", "debut_de_la_mesure", "starttijd", "begintijd",
    "begin_meting", "zacatek_mereni", "cas_zacatku", "starttid", "starttidspunkt",
)  # fmt: skip
# The day of a start whose time of day is in a line of its own.
START_DATE_NAMES = ("start_date", "startdatum", "date_de_debut", "begindatum", "datum_zacatku", "startdato")
# Unlike n_samples, which counts per record, these may count the rows of the whole file.
SAMPLE_COUNT_NAMES = (
    "number_of_samples", "no_of_samples", "num_samples", "sample_count", "samples", "total_samples", "nsamples",
    "number_of_points", "number_of_data_points", "no_of_points", "num_points", "data_points", "npts",
    "anzahl_messwerte", "anzahl_der_messwerte", "anzahl_werte", "anzahl_abtastwerte",
    "anzahl_samples", "anzahl_datenpunkte", "nombre_d_echantillons", "nombre_de_points", "aantal_samples",
    "aantal_meetwaarden", "aantal_meetpunten", "pocet_vzorku", "antal_samples", "antal_malepunkter",
    "antal_datapunkter",
)  # fmt: skip
TIME_NAMES = ("time", "t", "time_s")
CHANNEL_NAMES = (
    "channels", "channel_names", "names", "labels", "channel_labels", "signal_names", "sensor_names", "column_names",
    "columns", "block0_items",  # the last one by pandas, in HDF5
)  # fmt: skip
UNIT_NAMES = ("units", "unit", "channel_units")
ATTRIBUTES_MARK = " (attributes)"  # behind the name of a variable: the name of its attributes
RECORD_COUNT_NAMES = ("n_records", "n_record")
TEMPERATURES = ("rail_temperature", "air_temperature")
# Conditions with a quantity: in °C and m/s.
CONDITION_QUANTITIES = {**dict.fromkeys(TEMPERATURES, "temperature"), "speed": "velocity"}
