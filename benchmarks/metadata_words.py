"""Words of metadata that loggers write, in languages and styles that the readers' tables were not made from.

Per language: sampling rate, time step, record length, scale factor, zero offset, unit (all harmful when they contradict
the layout), then entries about other subjects with their values. Set E and set F share no language and no phrase. They
were written before the readers' tables of words were looked at; a set counts as fresh on its first run only.
"""

KINDS = ("rate", "step", "length", "scale", "offset", "unit")

LANGUAGES = {
    "E": {
        "Estonian": (
            ("Diskreetimissagedus", "Ajasamm", "Salvestuse kestus", "Mastaabitegur", "Nullinihe", "Mõõtühik"),
            {"Õhutemperatuur": "14 °C", "Rongi kiirus": "82 km/h", "Mõõtja": "Tamm", "Liipri number": 14},
        ),
        "Latvian": (
            (
                "Diskretizācijas biežums",
                "Laika solis",
                "Ieraksta ilgums",
                "Mēroga koeficients",
                "Nulles nobīde",
                "Mērvienība",
            ),
            {"Gaisa temperatūra": "12,5 °C", "Vilciena ātrums": "80 km/h", "Gulsnis": 21, "Āmura masa": "5,4 kg"},
        ),
        "Romanian": (
            (
                "Frecvența de eșantionare",
                "Pas de timp",
                "Durata înregistrării",
                "Factor de scală",
                "Decalaj de zero",
                "Unitate de măsură",
            ),
            {"Temperatura aerului": "18 °C", "Viteza trenului": "90 km/h", "Traversa": 7, "Operatorul": "Ionescu"},
        ),
        "Croatian": (
            (
                "Učestalost uzorkovanja",
                "Vremenski korak",
                "Trajanje zapisa",
                "Faktor skaliranja",
                "Pomak nule",
                "Mjerna jedinica",
            ),
            {"Temperatura zraka": "21 °C", "Brzina vlaka": "100 km/h", "Skretnica": 12, "Masa čekića": "5,4 kg"},
        ),
        "Ukrainian": (
            ("Частота вибірки", "Крок часу", "Тривалість запису", "Коефіцієнт масштабу", "Зсув нуля", "Одиниця виміру"),
            {"Температура повітря": "9 °C", "Швидкість поїзда": "60 км/год", "Шпала": 33, "Оператор": "Коваль"},
        ),
        "Greek": (
            (
                "Συχνότητα δειγματοληψίας",
                "Χρονικό βήμα",
                "Διάρκεια εγγραφής",
                "Συντελεστής κλίμακας",
                "Μετατόπιση μηδενός",
                "Μονάδα μέτρησης",
            ),
            {"Θερμοκρασία αέρα": "26 °C", "Ταχύτητα συρμού": "70 km/h", "Στρωτήρας": 8, "Χειριστής": "Νίκος"},
        ),
        "Korean": (
            ("샘플링 속도", "시간 간격", "기록 길이", "배율", "영점 오프셋", "단위"),
            {"기온": "17 °C", "열차 속도": "120 km/h", "침목 번호": 5, "작업자": "김"},
        ),
        "Indonesian": (
            ("Laju pencuplikan", "Selang waktu", "Lama rekaman", "Faktor pengali", "Geseran nol", "Satuan"),
            {"Suhu udara": "31 °C", "Kecepatan kereta": "75 km/jam", "Bantalan": 17, "Petugas": "Budi"},
        ),
        "Catalan": (
            (
                "Velocitat de mostratge",
                "Pas temporal",
                "Durada del registre",
                "Factor d'escalat",
                "Desplaçament del zero",
                "Unitat",
            ),
            {
                "Temperatura de l'aire": "19 °C",
                "Velocitat del tren": "95 km/h",
                "Travessa": 3,
                "Massa del martell": "5,4 kg",
            },
        ),
        "Icelandic": (
            ("Söfnunartíðni", "Tímaskref", "Lengd upptöku", "Kvarði", "Núllhliðrun", "Mælieining"),
            {"Lofthiti": "6 °C", "Hraði lestar": "50 km/klst", "Starfsmaður": "Jón", "Rafhlaða": "87 %"},
        ),
        "Afrikaans": (
            ("Monstertempo", "Tydstap", "Opnameduur", "Skaalfaktor", "Nulverskuiwing", "Eenheid"),
            {"Lugtemperatuur": "24 °C", "Treinspoed": "80 km/h", "Dwarslêer": 11, "Hamermassa": "5,4 kg"},
        ),
        "Hungarian": (
            (
                "Mintavételezési sebesség",
                "Időköz",
                "Felvétel hossza",
                "Léptékszorzó",
                "Nullponteltolás",
                "Mértékegység",
            ),
            {"Léghőmérséklet": "15 °C", "Vonat sebessége": "80 km/h", "Talpfa": 9, "Kezelő": "Kovács"},
        ),
    },
    "F": {
        "Lithuanian": (
            (
                "Diskretizavimo dažnis",
                "Laiko žingsnis",
                "Įrašo trukmė",
                "Mastelio daugiklis",
                "Nulio poslinkis",
                "Matavimo vienetas",
            ),
            {"Oro temperatūra": "11 °C", "Traukinio greitis": "70 km/h", "Pabėgis": 19, "Plaktuko masė": "5,4 kg"},
        ),
        "Slovenian": (
            (
                "Hitrost vzorčenja",
                "Časovni korak",
                "Trajanje posnetka",
                "Merilni faktor",
                "Ničelni odmik",
                "Merska enota",
            ),
            {"Temperatura ozračja": "16 °C", "Hitrost vlaka": "85 km/h", "Prag": 23, "Masa kladiva": "5,4 kg"},
        ),
        "Bulgarian": (
            (
                "Честота на дискретизация",
                "Стъпка по време",
                "Продължителност на записа",
                "Мащабен множител",
                "Нулево отместване",
                "Мерна единица",
            ),
            {"Температура на въздуха": "20 °C", "Скорост на влака": "65 km/h", "Траверса": 41, "Чук": "5,4 kg"},
        ),
        "Hebrew": (
            ("קצב דגימה", "צעד זמן", "משך הקלטה", "מקדם כיול", "היסט אפס", "יחידת מידה"),
            {"טמפרטורה": "28 °C", "מהירות רכבת": "90 km/h", "אדן": 6, "מפעיל": "כהן"},
        ),
        "Arabic": (
            ("معدل أخذ العينات", "الخطوة الزمنية", "مدة التسجيل", "معامل القياس", "إزاحة الصفر", "وحدة القياس"),
            {"درجة الحرارة": "35 °C", "سرعة القطار": "110 km/h", "عارضة": 13, "المشغل": "علي"},
        ),
        "Vietnamese": (
            ("Tốc độ lấy mẫu", "Bước thời gian", "Thời lượng ghi", "Hệ số tỉ lệ", "Độ lệch không", "Đơn vị"),
            {"Nhiệt độ": "29 °C", "Tốc độ tàu": "60 km/h", "Tà vẹt": 27, "Người đo": "Nguyễn"},
        ),
        "Basque": (
            (
                "Laginketa-abiadura",
                "Denbora-urratsa",
                "Grabazioaren iraupena",
                "Eskala-faktorea",
                "Zero-desplazamendua",
                "Unitatea",
            ),
            {"Airearen tenperatura": "13 °C", "Trenaren abiadura": "80 km/h", "Trabesa": 2, "Langilea": "Etxeberria"},
        ),
        "Welsh": (
            ("Cyfradd samplu", "Cam amser", "Hyd y recordiad", "Ffactor graddfa", "Gwrthbwyso sero", "Uned"),
            {"Tymheredd yr aer": "10 °C", "Cyflymder y trên": "70 mya", "Sliper": 4, "Màs y morthwyl": "5.4 kg"},
        ),
        "Thai": (
            ("อัตราการสุ่ม", "ช่วงเวลา", "ความยาวบันทึก", "ตัวคูณ", "ค่าชดเชยศูนย์", "หน่วยวัด"),
            {"อุณหภูมิ": "33 °C", "ความเร็วรถไฟ": "80 km/h", "หมอน": 15, "ผู้วัด": "สมชาย"},
        ),
        "Albanian": (
            (
                "Shpejtësia e mostrimit",
                "Hapi kohor",
                "Kohëzgjatja e regjistrimit",
                "Shumëzuesi",
                "Zhvendosja e zeros",
                "Njësia",
            ),
            {
                "Temperatura e ajrit": "22 °C",
                "Shpejtësia e trenit": "60 km/h",
                "Traversa nr": 31,
                "Pesha e çekiçit": "5,4 kg",
            },
        ),
        "Swahili": (
            ("Kasi ya sampuli", "Hatua ya muda", "Urefu wa rekodi", "Kizidishi", "Msogeo wa sifuri", "Kipimo"),
            {"Joto la hewa": "30 °C", "Kasi ya treni": "55 km/h", "Mtaruma": 10, "Mpimaji": "Juma"},
        ),
        "Irish": (
            ("Ráta samplála", "Céim ama", "Fad an taifid", "Fachtóir méadaithe", "Fritháireamh nialais", "Aonad"),
            {"Teocht an aeir": "9 °C", "Luas na traenach": "75 km/u", "Trasnán": 16, "Oibreoir": "Ó Briain"},
        ),
    },
}

# Phrases that are then written as loggers do: runTogether, snake_case, dotted, without vowels, cut, mistyped.
PHRASES = {
    "E": {
        "rate": (
            "record pace",
            "acquisition tempo",
            "digitise rate",
            "front end clock",
            "readings each second",
            "conversion speed",
        ),
        "step": ("reading spacing", "point distance", "tick length", "sample gap", "abscissa pitch", "frame interval"),
        "length": ("capture extent", "shot length", "window span", "trace duration"),
        "scale": (
            "channel multiplier",
            "bit weight",
            "sensor constant",
            "calibration slope",
            "amp setting",
            "physical per raw",
        ),
        "offset": ("zero shift", "dc level", "rest value", "tare amount", "baseline shift"),
        "unit": ("engineering label", "y dimension", "quantity measure", "axis text", "physical dim"),
    },
    "F": {
        "rate": (
            "logging cadence",
            "adc throughput",
            "values a second",
            "stream velocity",
            "oscillator divided",
            "burst tempo",
        ),
        "step": ("scan spacing", "time quantum", "row pitch", "delay to next point", "x advance", "slot width"),
        "length": ("buffer seconds", "impact window", "event extent", "slice duration"),
        "scale": (
            "transducer ratio",
            "step weight",
            "linear coefficient",
            "conversion number",
            "boost",
            "eu each count",
        ),
        "offset": ("subtracted mean", "null reading", "quiescent value", "intercept value", "balance residue"),
        "unit": ("value kind", "ordinate label", "measured in", "display dimension", "phys quantity"),
    },
}

# Names that say nothing, with a value of each kind.
OPAQUE = {
    "E": ("par12", "reg[0x1A]", "opt.b", "cfg/3", "u8_5", "Q7", "val", "slot2.c", "_k", "fld_09"),
    "F": ("X19", "tag:44", "misc.7", "arg3", "w0", "aux(2)", "thing", "#5", "prm_q", "blk1/v"),
}

# Names of other subjects, under which a plain rate stands.
STRONG = {
    "E": (
        "direction",
        "temperature",
        "operator",
        "weather",
        "battery",
        "train type",
        "sleeper",
        "cable",
        "serial number",
        "location",
    ),
    "F": ("position", "humidity", "customer", "remark", "supply", "axle", "ballast", "hammer", "device id", "latitude"),
}
RATES_UNDER_STRONG = {
    "E": ("{k:g} kS/s", "{r:g} samples/s", "{r:g} Sa/s", "sampled at {k:g} kHz", "{k:g} ksps"),
    "F": ("{r:g} S/s", "{k:g}kSa/s", "{r:g} samples per second", "{r:g} Hz sampling", "{u:g} us/sample"),
}

# Headers of loggers, all true of a record of 64 samples at 25.6 kHz in N and m/s2.
BENIGN = {
    "E": (
        {
            "Instrument type": "VC-440",
            "Instrument no.": "VC-0081",
            "Strap": "magnetic",
            "Beep": "on",
            "Free memory": "61 %",
            "Job card": "A7/3",
        },
        {
            "rig": "trolley 2",
            "crew": "Lund, Holm",
            "start km": 41.235,
            "nose gap": "38 mm",
            "rail head wear": "4.1 mm",
            "lubricated": "yes",
            "cant": "80 mm",
        },
        {
            "fpga_build": "0x2024a1",
            "adc_die_temp": "41.5 °C",
            "vref": "2.5 V",
            "lost_packets": 0,
            "ptp_offset": "120 ns",
            "ptp_state": "SLAVE",
        },
        {
            "Anfahrt": "B27",
            "Posten": "Sipo West",
            "Sperrung von": "22:10",
            "Sperrung bis": "04:30",
            "Feuchte": "81 %",
            "Laschenspalt": "6 mm",
        },
        {
            "ID du capteur": "LW-3391",
            "Vent": "12 km/h",
            "Équipe": "nuit",
            "Usure du cœur": "3 mm",
            "Pose": "2012",
            "Nature du ballast": "granit",
        },
        {"n_ch": 2, "n_smp": 64, "endian": "<", "dtype": "f8", "writer": "rec.rs 0.3.1", "sha": "b41f09e"},
        {
            "Impact": "3 of 5",
            "Peak": "1.5 kN",
            "Contact": "1.2 ms",
            "Tip colour": "red",
            "Rebound": "none",
            "Coherence mean": 0.96,
        },
        {"fs": 25600, "dt": "39.0625 us", "npts": 64, "units": "N, m/s²", "gain": 1, "offset": 0},
        {"Acquisition": "25.6 kS/s, 24 bit, IEPE on", "Length": "2.5 ms", "Channels": "2 of 4", "Storage": "internal"},
        {"hum": 61, "temp": 12.5, "lat": 56.1629, "lon": 10.2039, "sats": 11, "bat": "3.91 V", "tilt": "0.4 deg"},
        {
            "Mounting": "stud M5",
            "Torque applied": "2 Nm",
            "Surface": "ground",
            "Glue": "none",
            "Cable run": "10 m",
            "Connector": "10-32",
        },
        {
            "Loco": "MY 1112",
            "Consist": "12 wagons",
            "Gross": "980 t",
            "Axle count": 50,
            "Wheel flats": 1,
            "Passing at": "62 km/h",
        },
    ),
    "F": (
        {
            "Analyser": "Photon+",
            "Dongle": "A-3391",
            "User": "shift B",
            "Template": "Impact.tpl",
            "Printed": "no",
            "Pages": 2,
            "Zoom": "100 %",
        },
        {
            "kit": 4,
            "spare hammer": "no",
            "nut torque": "150 Nm",
            "wing wear": "2.2 mm",
            "gauge": "1436 mm",
            "cross level": "-2 mm",
            "grade": "5 permille",
        },
        {
            "modem_imsi": "2620112345",
            "rsrp": "-97 dBm",
            "uptime": "86400 s",
            "heap": "20 kB",
            "boot": 12,
            "vcc": "3.30 V",
        },
        {
            "Auftrag": "2024-118",
            "Streckensperrung": "ja",
            "Stopfgang": "2023",
            "Schienenbruch": "nein",
            "Schraubenmoment": "250 Nm",
            "Liegezeit": "12 a",
        },
        {
            "Cantiere": "Faenza",
            "Squadra": 3,
            "Umidità": "70 %",
            "Gioco": "1 mm",
            "Usura": "2 mm",
            "Pioggia": "no",
            "Sensore": "LW-51",
        },
        {"cols": 2, "rows": 64, "sep": "tab", "enc": "utf-8", "exporter": "py 3.11", "md5": "9b1c22"},
        {
            "Hit": 4,
            "Of": 6,
            "Max": "2.1 kN",
            "Pulse width": "0.9 ms",
            "Tip": "084A62",
            "Repeat": "no",
            "Quality": "0.97",
        },
        {
            "rate_hz": 25600,
            "delta_t_ms": 0.0390625,
            "length_samples": 64,
            "unit": ["N", "m/s²"],
            "scale": 1.0,
            "bias": 0.0,
        },
        {"Recorder setup": "2 x 25.6 kHz, 24 bit", "Duration": "2.5 ms", "Format": "wave64", "Preroll": "0.5 ms"},
        {
            "wind_speed": "3 m/s",
            "pressure": "1009 hPa",
            "dew": "8 °C",
            "solar": "210 W/m2",
            "heading": "271 deg",
            "vbus": "5.1 V",
        },
        {
            "Stud": "M8",
            "Adhesive": "X60",
            "Finish": "painted",
            "Lead": "5 m",
            "Plug": "BNC",
            "Shield": "grounded",
            "Batch": 7,
        },
        {"Unit no": 185, "Cars": 8, "Load": "empty", "Braking": "no", "Driver": "K", "Track no": 2, "Passage": "17:41"},
    ),
}
