"""Virtual impedance: attraction, repulsion, a controller a law."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.laws.active_impedance_2017_controller import (
        ActiveImpedance2017Controller,
        ActiveImpedance2017Controller_,
        active_2017_force,
    )
    from systems.laws.active_impedance_controller import (
        ActiveImpedanceController,
        ActiveImpedanceController_,
        active_force,
    )
    from systems.laws.catalogue import LAWS, law_title
    from systems.laws.conventional_impedance_2017_controller import (
        ConventionalImpedance2017Controller,
        ConventionalImpedance2017Controller_,
        conventional_2017_force,
    )
    from systems.laws.conventional_impedance_controller import (
        ConventionalImpedanceController,
        ConventionalImpedanceController_,
        conventional_force,
    )
    from systems.laws.impedance import attraction_force, repulsion_force
    from systems.laws.law import Equation, Law, Tuning
    from systems.laws.parameters import AttractionParameters
    from systems.laws.radial_law_controller import (
        RadialLawController,
        RadialLawController_,
    )
    from systems.laws.repulsion import RepulsionParameters
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "LAWS",
    "ActiveImpedance2017Controller",
    "ActiveImpedance2017Controller_",
    "ActiveImpedanceController",
    "ActiveImpedanceController_",
    "AttractionParameters",
    "ConventionalImpedance2017Controller",
    "ConventionalImpedance2017Controller_",
    "ConventionalImpedanceController",
    "ConventionalImpedanceController_",
    "Equation",
    "Law",
    "RadialLawController",
    "RadialLawController_",
    "RepulsionParameters",
    "Tuning",
    "active_2017_force",
    "active_force",
    "attraction_force",
    "conventional_2017_force",
    "conventional_force",
    "law_title",
    "repulsion_force",
]
