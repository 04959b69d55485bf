"""Cantilevers, scanners and material pairs by name, each number with its source or "typical, not measured".

Numbers of makers are nominal; each can be replaced by a parameter of the plant. In words: docs/microscope.md.
"""

import math
from typing import NamedTuple

from ..core.elementary import square


class LeverPreset(NamedTuple):
    """A cantilever, SI units."""

    k: float  # spring constant
    f0: float  # first resonance
    Q: float  # quality factor in air
    length: float
    width: float
    thickness: float
    tip_height: float
    tip_radius: float
    k_torsion: float  # torque per angle; 0: by the formula of a rectangular cantilever
    k_in_plane: float  # stiffness of the end sideways; 0: likewise
    f_torsion: float = 0.0  # first torsional resonance, free; 0: likewise
    Q_torsion: float = 0.0  # its quality factor; 0: Q


LEVERS = {
    # Dimensions as measured by Tafazzoli et al. (2004); k nominal of the maker (Nanosensors PPP-LFMR). f0 is that of
    # silicon (2330 kg/m^3) with these numbers, 30 nm of aluminium and the mass of the tip; the maker's nominal 23 kHz
    # would need 28 % more mass. Tip radius, Q: typical, not measured; Q of Sader (1998) less a fifth.
    "ppp_lfmr": LeverPreset(0.2, 26e3, 40.0, 225e-6, 48e-6, 1e-6, 12e-6, 10e-9, 0.0, 0.0),
    # Nominal of makers of contact cantilevers of 450 um; f0 is that of silicon, as above, within 2 %. The thickness is
    # rounded: 2.05 um, there 1.04 um, gives this k. Height and radius of the tip, Q: typical, not measured.
    "contal_g": LeverPreset(0.2, 13e3, 50.0, 450e-6, 50e-6, 2e-6, 17e-6, 10e-9, 0.0, 0.0),
    # V-shaped: torsion from a lateral stiffness of 56.2 N/m at the tip, calculated from the measured k (table 2 of
    # Nanoscale Res. Lett. 7:608, doi:10.1186/1556-276X-7-608); that it does not bend in its plane is assumed. Measured
    # k = 0.16 N/m (nominal 0.12). f0, tip radius: nominal of the maker (Bruker SNL-10, B); Q: typical, not measured.
    "snl_10b": LeverPreset(0.16, 23e3, 30.0, 205e-6, 40e-6, 0.6e-6, 8e-6, 2e-9, 56.2 * square(8e-6), 1e3),
    # For dynamic modes. k and dimensions nominal of the makers (Nanosensors PPP-FMR and PPP-NCHR, MikroMasch HQ:NSC14
    # with aluminium); f0 is that of silicon with these numbers and the mass of the tip, as of ppp_lfmr, where the
    # makers' nominal is 75, 330 and 160 kHz. Tip height and radius: nominal or typical. Q of Sader (1998) less a fifth.
    "ppp_fmr": LeverPreset(2.8, 77e3, 165.0, 225e-6, 28e-6, 3e-6, 12.5e-6, 10e-9, 0.0, 0.0),
    "nsc14": LeverPreset(5.0, 158e3, 210.0, 125e-6, 25e-6, 2.1e-6, 13.5e-6, 8e-9, 0.0, 0.0),
    "ppp_nchr": LeverPreset(42.0, 330e3, 520.0, 125e-6, 30e-6, 4e-6, 12.5e-6, 10e-9, 0.0, 0.0),
}


class ScannerPreset(NamedTuple):
    """A scanner with the sample on it, SI units: stiffness, resonance, quality factor."""

    k_x: float
    k_y: float
    k_z: float
    f_x: float
    f_y: float
    f_z: float
    Q: float


def _scanner(mass: float, f_xy: float, mass_z: float, f_z: float, Q: float) -> ScannerPreset:
    k_xy, k_z = (square(6.283185307179586 * f) * m for f, m in ((f_xy, mass), (f_z, mass_z)))
    return ScannerPreset(k_xy, k_xy, k_z, f_xy, f_xy, f_z, Q)


SCANNERS = {
    # Moving masses, quality factors and the first two kinds' resonances: typical, not measured.
    "flexure_90um": _scanner(50e-3, 500.0, 5e-3, 5e3, 20.0),
    "tube_100um": _scanner(20e-3, 850.0, 20e-3, 5e3, 30.0),
    # Lowest resonance 22 kHz: Schitter et al. (2007), doi:10.1109/TCST.2007.902953.
    "stack_13um": _scanner(2e-3, 22e3, 2e-3, 22e3, 10.0),
}


class PairPreset(NamedTuple):
    """Materials of tip and sample, SI units."""

    K: float  # reduced modulus, 4 E*/3
    G: float  # reduced shear modulus G*
    work_of_adhesion: float
    tau: float  # interfacial shear strength
    hamaker: float  # Hamaker constant
    range: float  # of the adhesive stress, z_0


class Material(NamedTuple):
    """Elasticity of a half-space of a material under a round contact."""

    plane: float  # 1 over the indentation modulus, (1 - nu^2) / E if isotropic [1/Pa]
    shear: float  # under a lateral force, (2 - nu) / G if isotropic [1/Pa]


def isotropic(E: float, nu: float) -> Material:
    """Of Young's modulus [Pa] and Poisson's ratio."""
    return Material((1.0 - nu * nu) / E, (2.0 - nu) * 2.0 * (1.0 + nu) / E)


def layered(c11: float, c12: float, c13: float, c33: float, c44: float) -> Material:
    """Of the elastic constants [Pa] of a crystal whose layers lie in the surface.

    Indentation: Delafargue and Ulm (2004), doi:10.1016/j.ijsolstr.2004.06.019. Sideways half is shear of the surface in
    its plane, 1 / sqrt(c44 c66), half is 2 / modulus times sqrt(c33 / c11); for equal directions that is (2 - nu) / G.
    """
    mean = math.sqrt(c11 * c33)
    modulus = 2.0 * math.sqrt((mean * mean - c13 * c13) / c11 / (1.0 / c44 + 2.0 / (mean + c13)))
    return Material(1.0 / modulus, 1.0 / math.sqrt(0.5 * c44 * (c11 - c12)) + 2.0 / modulus * math.sqrt(c33 / c11))


ELASTIC = {
    # Silicon along <110>, Hopcroft, Nix, Kenny (2010), doi:10.1109/JMEMS.2009.2039697, taken as isotropic.
    # The other isotropic ones: typical, not measured, as in handbooks.
    "si": isotropic(169e9, 0.27),
    "sio2": isotropic(70e9, 0.17),
    "si3n4": isotropic(250e9, 0.25),
    # Vaughan and Guggenheim (1986), doi:10.1029/JB091iB05p04657: means along its two directions, nearly hexagonal.
    "mica": layered(179.7e9, 48.8e9, 23.4e9, 58.6e9, 18.0e9),
    # Bosak et al. (2007), doi:10.1103/PhysRevB.75.153408.
    "graphite": layered(1109e9, 139e9, 0.0, 38.7e9, 4.95e9),
    "polystyrene": isotropic(3.2e9, 0.33),
    "gold": isotropic(78e9, 0.42),
    "nacl": isotropic(40e9, 0.25),
}
"""Of tips and samples."""


def _pair(tip: str, sample: str, adhesion: float, tau: float, hamaker: float, reach: float = 0.165e-9) -> PairPreset:
    plane = shear = 0.0
    for material in (ELASTIC[tip], ELASTIC[sample]):
        plane += material.plane
        shear += material.shear
    return PairPreset(4.0 / (3.0 * plane), 1.0 / shear, adhesion, tau, hamaker, reach)


PAIRS = {
    # Adhesion and shear strength: typical, not measured, the order of size in dry gas. Hamaker constants go with the
    # adhesion, w = H / (12 pi z_0^2), and z_0 is 0.165 nm: Israelachvili, Intermolecular and Surface Forces, 13.
    "si_sio2": _pair("si", "sio2", 0.10, 0.6e9, 1.0e-19),
    "si3n4_mica": _pair("si3n4", "mica", 0.10, 0.5e9, 1.0e-19),
    "si_graphite": _pair("si", "graphite", 0.08, 0.02e9, 0.8e-19),
    "si_polystyrene": _pair("si", "polystyrene", 0.08, 0.03e9, 0.8e-19),
    "si3n4_gold": _pair("si3n4", "gold", 0.15, 0.5e9, 1.5e-19),
    "si_nacl": _pair("si", "nacl", 0.10, 0.3e9, 1.0e-19),
}
