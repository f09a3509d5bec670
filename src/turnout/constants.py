"""Physical and statistical constants that several packages use. All values are in SI units unless stated."""

GRAVITY = 9.81  # m/s², acceleration of gravity in the simulation
STANDARD_GRAVITY = 9.80665  # m/s², by definition of the units g and kgf
NEWTON_PER_TONNE = 9806.65  # N, weight of 1 t in standard gravity
KMH = 3.6  # km/h in 1 m/s
Z95 = 1.96  # half width of a 95 % interval in standard errors, rounded as on the pages
Z95_EXACT = 1.959964  # the same with the digits that the texts of a finding use
MAD_TO_SD = 1.4826  # standard deviation of normal values over their median absolute deviation
DAYS_PER_YEAR = 365.25  # d, of the Julian calendar
