"""The result of a comparison: a table of runs, a ranking of laws, files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import ParameterError
from ..core.schema import python_value
from ..parameters import ControllerParameters, SimParameters, build, flatten
from .contender import CONDITIONS, Common, Contender, instrument_under, law_under

if TYPE_CHECKING:
    import pandas as pd

RANKED = ("error_max", "z_rms", "chatter", "energy", "tip_force", "margin")
"""By which laws are ranked; less is better, but for the margin."""
_LATEX = str.maketrans(
    {each: "\\" + each for each in "_&%#${}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)
UNDER = 1.0
"""Error [% of amplitude] up to which a run counts as good."""


@dataclass(frozen=True)
class Comparison:
    """A finished comparison.

    Parameters
    ----------
    table : DataFrame
        A row a run: `law`, the conditions, then `error_max` and `error_rms` [% of amplitude, worse of x and y],
        `chatter` (total variation of the drive of x and y over that of the smooth drive), `energy` (mean square of the
        drive of x and y [V^2]), `tip_force` (largest normal force, pull or push [N]), `contact` (part of the time),
        `margin` (smallest distance of the open loop from -1; 0: unstable; missing: no linear model), `z_rms` [m],
        `trajectory_sha256`, and `error`: the sentence of a run that diverged, was refused, passed a limit, left the
        sample, held the tip at another height or is doubtful.
    contenders : tuple of Contender
    common : Common
    """

    table: pd.DataFrame
    contenders: tuple[Contender, ...]
    common: Common

    def ranking(self) -> pd.DataFrame:
        """A row a law, the best first: by the part of runs under 1 %, then by the median error.

        A run with an `error` counts as infinite in all of them. `rank_...` is the place by each.
        """
        import pandas

        rows = []
        for each in self.contenders:
            runs = self.table[self.table["law"] == each.label]
            bad = runs["error"].notna()
            medians = {name: float(runs[name].where(~bad, math.inf).median()) for name in RANKED[:-1]}
            margins = runs["margin"].dropna()
            rows.append(
                {
                    "law": each.label,
                    "runs": len(runs),
                    "finished": int((~bad).sum()),
                    "good": float(((runs["error_max"] <= UNDER) & ~bad).mean()) if len(runs) else math.nan,
                    **medians,
                    "margin": float(margins.median()) if len(margins) else math.nan,
                    "knowledge": each.knowledge,
                }
            )
        table = pandas.DataFrame(rows).sort_values(["good", "error_max"], ascending=[False, True], kind="stable")
        for name in RANKED:
            ranks = table[name].rank(method="min", ascending=name != "margin", na_option="bottom")
            table[f"rank_{name}"] = ranks.astype(int)
        return table.reset_index(drop=True)

    def best_of(self, groups: Sequence[Sequence[Contender]]) -> Comparison:
        """With the one law of each group that ranks best."""
        places = self.ranking()["law"].tolist()
        best = tuple(min(group, key=lambda each: places.index(each.label)) for group in groups)
        kept = self.table["law"].isin([each.label for each in best])
        return Comparison(self.table[kept].reset_index(drop=True), best, self.common)

    def to_csv(self, path: Path) -> None:
        """Write the table, all digits."""
        self.table.to_csv(path, index=False)

    def to_latex(self) -> str:
        """The ranking as a table for LaTeX (booktabs)."""
        lines = [
            r"\begin{tabular}{lrrrrrrr}",
            r"\toprule",
            r"law & runs & finished & under 1\,\% & error [\%] & chatter & tip force [nN] & margin \\",
            r"\midrule",
        ]
        for row in self.ranking().itertuples():
            numbers = (100.0 * row.good, row.error_max, row.chatter, 1e9 * row.tip_force, row.margin)
            cells = [f"{number:.3g}" if math.isfinite(number) else "--" for number in numbers]
            cells[0] += r"\,\%"
            name = str(row.law).translate(_LATEX)
            lines.append(f"{name} & {row.runs} & {row.finished} & {' & '.join(cells)} \\\\")
        return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])

    def scenario_of(self, number: int) -> dict[str, dict[str, Any]]:
        """Sections of a scenario file for one row: the same run over topics, by `session`.

        Of a law that runs elsewhere: the instrument's alone; a session starts a node as `--controller COMMAND`.

        Raises
        ------
        ParameterError
            If the law of the row is an object.
        """
        row = self.table.iloc[number]
        law = next(each for each in self.contenders if each.label == row["law"])
        conditions = {name: python_value(row[name]) for name in CONDITIONS}
        sim = instrument_under(self.common, conditions)
        plain, default = flatten(sim), flatten(SimParameters())
        instrument = {name: value for name, value in plain.items() if value != default.get(name)}
        if law.start is not None:
            return {"/**/afm_sim_node": instrument}
        if not law.is_part:
            raise ParameterError(
                f"law {law.label} is an object and no part: a session starts it as --controller COMMAND"
            )
        controller = law_under(self.common, law, conditions, sim)
        own, usual = flatten(controller), flatten(build(ControllerParameters, {"law.kind": law.kind}))
        given = {name: value for name, value in own.items() if name == "law.kind" or value != usual.get(name)}
        return {"/**/afm_sim_node": instrument, "/**/afm_controller_node": given}
