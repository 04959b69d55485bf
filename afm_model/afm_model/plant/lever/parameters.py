"""Parameters of the plant `lever`, and the numbers that they and the presets come to."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from ...cantilever import beam
from ...cantilever.tilted import tilted_deflection, tilted_stiffness
from ...core.elementary import cbrt, square
from ...core.schema import NonNegative, Positive, Unit
from ..presets import LEVERS, PAIRS, SCANNERS, LeverPreset, PairPreset, ScannerPreset
from .loss import LossParameters

_PRESET = "0: that of the preset"
_Newton_per_metre = Annotated[NonNegative, Unit("N/m")]
_Metre = Annotated[NonNegative, Unit("m")]
_Hertz = Annotated[NonNegative, Unit("Hz")]


class LeverGroup(LossParameters):
    """A scanner and a cantilever as in a laboratory: the tip sticks, the cantilever bends and twists."""

    kind: str = Field("lever", description="equations of motion")
    control_period: Annotated[Positive, Unit("s")] = Field(20e-6, description="control period, a multiple of dt")
    lever: Literal["ppp_lfmr", "contal_g", "snl_10b", "ppp_fmr", "nsc14", "ppp_nchr"] = Field(
        "ppp_lfmr", description="preset of the cantilever"
    )
    k: _Newton_per_metre = Field(0.0, description=f"spring constant of the cantilever; {_PRESET}")
    f0: _Hertz = Field(0.0, description=f"first resonance of the cantilever, free; {_PRESET}")
    Q: NonNegative = Field(0.0, description=f"quality factor of the cantilever; {_PRESET}")
    length: _Metre = Field(0.0, description=f"length of the cantilever; {_PRESET}")
    width: _Metre = Field(0.0, description=f"width of the cantilever; {_PRESET}")
    thickness: _Metre = Field(0.0, description=f"thickness of the cantilever; {_PRESET}")
    tip_height: _Metre = Field(0.0, description=f"height of the tip below the cantilever; {_PRESET}")
    tip_radius: _Metre = Field(0.0, description=f"radius of the tip; {_PRESET}")
    k_torsion: Annotated[NonNegative, Unit("N m/rad")] = Field(
        0.0, description="torque per angle of twist; 0: that of the preset, or of a rectangular cantilever"
    )
    k_in_plane: _Newton_per_metre = Field(
        0.0, description="stiffness sideways without twist; 0: that of the preset, or of a rectangular cantilever"
    )
    f_torsion: _Hertz = Field(
        0.0, description="first torsional resonance, free; 0: that of the preset, or of a rectangular cantilever"
    )
    Q_torsion: NonNegative = Field(0.0, description="quality factor of torsion; 0: that of bending")
    torsion: Literal["static", "moving"] = Field(
        "static",
        description="torsion follows the force without delay, or its first mode moves: then take dt <= 0.5e-6 s",
    )
    tilt: Annotated[float, Gt(-0.8), Lt(0.8), Unit("rad")] = Field(
        0.2, description="angle by which the cantilever points down to the sample"
    )
    modes: Annotated[int, Ge(1), Le(3)] = Field(
        2, description="bending modes that move; those beyond follow the force without delay"
    )
    scanner: Literal["flexure_90um", "tube_100um", "stack_13um"] = Field(
        "flexure_90um", description="preset of the scanner"
    )
    k_x: _Newton_per_metre = Field(0.0, description=f"stiffness of the scanner along x; {_PRESET}")
    k_y: _Newton_per_metre = Field(0.0, description=f"stiffness of the scanner along y; {_PRESET}")
    k_z: _Newton_per_metre = Field(0.0, description=f"stiffness of the scanner along z; {_PRESET}")
    f_x: _Hertz = Field(0.0, description=f"resonance of the scanner along x; {_PRESET}")
    f_y: _Hertz = Field(0.0, description=f"resonance of the scanner along y; {_PRESET}")
    f_z: _Hertz = Field(0.0, description=f"resonance of the scanner along z; {_PRESET}")
    Q_scanner: NonNegative = Field(0.0, description=f"quality factor of the scanner; {_PRESET}")
    pair: Literal["si_sio2", "si3n4_mica", "si_graphite", "si_polystyrene", "si3n4_gold", "si_nacl"] = Field(
        "si_sio2", description="preset of the materials of tip and sample"
    )
    K: Annotated[NonNegative, Unit("Pa")] = Field(0.0, description=f"reduced elastic modulus, 4 E*/3; {_PRESET}")
    G: Annotated[NonNegative, Unit("Pa")] = Field(0.0, description=f"reduced shear modulus G*; {_PRESET}")
    work_of_adhesion: Annotated[NonNegative, Unit("J/m^2")] = Field(0.0, description=f"work of adhesion; {_PRESET}")
    tau: Annotated[NonNegative, Unit("Pa")] = Field(0.0, description=f"interfacial shear strength; {_PRESET}")
    strengthening: NonNegative = Field(
        0.0, description="growth of friction with the velocity of sliding: F (1 + strengthening ln(1 + v / slow))"
    )
    slow: Annotated[Positive, Unit("m/s")] = Field(1e-6, description="velocity from which friction grows")
    hamaker: Annotated[NonNegative, Unit("J")] = Field(
        0.0, description=f"Hamaker constant of the attraction before contact; {_PRESET}"
    )
    range: _Metre = Field(0.0, description=f"range z_0 of the adhesive stress; {_PRESET}")
    temperature: Annotated[NonNegative, Unit("K")] = Field(
        0.0,
        description="thermal noise of cantilever and apex, each by a separate stream from seed; 0: none",
    )
    contact: Literal["maugis", "jkr", "dmt"] = Field(
        "maugis", description="adhesive contact; maugis takes its place between dmt and jkr from materials and radius"
    )
    gap: _Metre = Field(
        0.0, description="distance of the free tip from the sample at the start; 0: in contact at reference.z_r"
    )

    @property
    def cantilever_numbers(self) -> LeverPreset:
        """The preset with what is given in its place; torsion and in-plane bending by docs/lever.md (5), (25)."""
        preset = LEVERS[self.lever]
        chosen = LeverPreset(*(getattr(self, name) or getattr(preset, name) for name in LeverPreset._fields))
        # Of the preset, unless the cantilever is another one.
        shape = ("k", "length", "width", "thickness", "tip_height")
        same = all(getattr(chosen, name) == getattr(preset, name) for name in shape)
        k_torsion = self.k_torsion or (preset.k_torsion if same else 0.0)
        k_in_plane = self.k_in_plane or (preset.k_in_plane if same else 0.0)
        slender = chosen.thickness / chosen.width
        by_shape = chosen.k * square(chosen.length) * 4.0 / 3.0 * SHEAR * (1.0 - 0.63 * slender)
        k_torsion = k_torsion or by_shape
        mass = beam.mass(chosen.k, chosen.f0)
        return chosen._replace(
            k_torsion=k_torsion,
            k_in_plane=k_in_plane or chosen.k / square(slender),
            f_torsion=chosen.f_torsion or beam.torsional_resonance(k_torsion, mass, chosen.width, chosen.thickness),
            Q_torsion=chosen.Q_torsion or chosen.Q,
        )

    def vertical_stiffness(self, parameters: Any) -> float:
        """Vertical force over vertical motion of the tip [N/m]."""
        return tilted_stiffness(self.spring_constant(parameters), *self._tilted)

    def deflection_under(self, parameters: Any, force: float) -> float:
        """Deflection that is shown under a vertical force [m]: across the tilted cantilever, by its slope."""
        return force / self.vertical_stiffness(parameters) * tilted_deflection(*self._tilted)

    @property
    def _tilted(self) -> tuple[float, float, float]:
        """Tilt [rad], height of the tip below the neutral axis, length [m]."""
        c = self.cantilever_numbers
        return self.tilt, c.tip_height + 0.5 * c.thickness, c.length

    @property
    def scanner_numbers(self) -> ScannerPreset:
        """The preset with what is given in its place."""
        preset = SCANNERS[self.scanner]
        return ScannerPreset(
            *(
                getattr(self, "Q_scanner" if name == "Q" else name) or getattr(preset, name)
                for name in ScannerPreset._fields
            )
        )

    @property
    def pair_numbers(self) -> PairPreset:
        """The preset with what is given in its place."""
        preset = PAIRS[self.pair]
        return PairPreset(*(getattr(self, name) or getattr(preset, name) for name in PairPreset._fields))

    @property
    def transition(self) -> float:
        """Transition parameter lambda on a flat sample [1], docs/lever.md (9): 0 for DMT, without bound for JKR."""
        if self.contact != "maugis":
            return 0.0
        pair, R = self.pair_numbers, self.cantilever_numbers.tip_radius
        stress = DUGDALE * pair.work_of_adhesion / pair.range
        return 2.0 * stress * cbrt(R / (math.pi * pair.work_of_adhesion * square(pair.K)))

    @property
    def contact_units(self) -> "ContactUnits":
        """Units of the contact on a flat sample."""
        pair, R = self.pair_numbers, self.cantilever_numbers.tip_radius
        w, K = pair.work_of_adhesion, pair.K
        return ContactUnits(
            force=math.pi * w * R,
            radius=cbrt(math.pi * w * R * R / K),
            indentation=cbrt(square(math.pi * w / K) * R),
        )


SHEAR = 50.9 / 169.0
"""G over E of the cantilever: silicon along <110> on a wafer (001), Hopcroft, Nix, Kenny (2010),
doi:10.1109/JMEMS.2009.2039697. In a material alike in all directions it would be 1 / (2 (1 + nu)).
"""
DUGDALE = 16.0 / (9.0 * math.sqrt(3.0))
"""Largest stress of a Lennard-Jones potential times its range over the work of adhesion."""


@dataclass(frozen=True)
class ContactUnits:
    """Units of afm_model.contact.maugis in SI."""

    force: float  # pi w R [N]
    radius: float  # [m]
    indentation: float  # [m]
