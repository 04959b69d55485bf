"""All parameters of a controller: the law, and what it believes of the microscope."""

from pydantic import model_validator

from ..core import registry
from ..core.schema import Group
from ..law import PaperLaw
from ..piezo import PiezoParameters
from ..plant.physics import Cantilever, Contact, Scales, Scanner
from ..sample import PaperSample


class ControllerParameters(Group):
    """The law and what the controller believes of the microscope."""

    law: PaperLaw = PaperLaw()
    scanner: Scanner = Scanner()
    cantilever: Cantilever = Cantilever()
    scales: Scales = Scales()
    piezo: PiezoParameters = PiezoParameters()
    contact: Contact = Contact()
    sample: PaperSample = PaperSample()

    @model_validator(mode="after")
    def _law_allows(self) -> "ControllerParameters":
        registry.find("law", self.law.kind).check(self)
        return self
