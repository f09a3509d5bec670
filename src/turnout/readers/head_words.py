"""What loggers call the start and the count of samples, in the languages of Europe: lower case, no accents, "_"."""

START = (
    "started_at", "start_time", "starttime", "wf_start_time", "startzeit", "startzeitpunkt", "messbeginn", "messstart",
    "beginn_der_messung", "heure_de_debut", "debut_de_mesure", "debut_de_la_mesure", "starttijd", "begintijd",
    "begin_meting", "zacatek_mereni", "cas_zacatku", "starttid", "starttidspunkt",
)  # fmt: skip
# The day of a start whose time of day stands in a line of its own.
START_DATE = ("start_date", "startdatum", "date_de_debut", "begindatum", "datum_zacatku", "startdato")
# Unlike n_samples, which is of each record, these may count the rows of the whole file.
SAMPLES = (
    "number_of_samples", "anzahl_messwerte", "anzahl_der_messwerte", "anzahl_werte", "anzahl_abtastwerte",
    "anzahl_samples", "anzahl_datenpunkte", "nombre_d_echantillons", "nombre_de_points", "aantal_samples",
    "aantal_meetwaarden", "aantal_meetpunten", "pocet_vzorku", "antal_samples", "antal_malepunkter",
    "antal_datapunkter",
)  # fmt: skip
