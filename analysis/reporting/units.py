"""Units, which the endings of names mean everywhere in this project."""

from __future__ import annotations

#: Units by the endings of names; longest endings first.
UNITS = {
    "_n_s_m": "N s/m",
    "_rad_s3": "rad/s\u00b3",
    "_m_s3": "m/s\u00b3",
    "_rad_m": "rad/m",
    "_rad_s": "rad/s",
    "_per_s": "1/s",
    "_1_s": "1/s",
    "_m_s2": "m/s\u00b2",
    "_n_m": "N/m",
    "_m_s": "m/s",
    "_deg": "deg",
    "_db": "dB",
    "_rad": "rad",
    "_j": "J",
    "_n": "N",
    "_m": "m",
    "_s": "s",
}


def without_unit(name: str) -> tuple[str, str]:
    """Splits `top_energy_j` into 'top_energy' and the unit 'J', which may be empty."""
    for ending, unit in UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending), unit
    return name, ""
