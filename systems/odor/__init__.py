"""Wind, odour plume, and the sensors that feel them."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.odor.airflow_sensors import AirflowSensors
    from systems.odor.gas_sensor_array import GasSensorArray
    from systems.odor.odor_plume import OdorPlume, concentration
    from systems.odor.parameters import (
        AirflowParameters,
        GasSensorParameters,
        OdorParameters,
        WindParameters,
    )
    from systems.odor.steady_plume import sharan_concentration, steady_concentration
    from systems.odor.wind import WindField, wind_velocity
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "AirflowParameters",
    "AirflowSensors",
    "GasSensorArray",
    "GasSensorParameters",
    "OdorParameters",
    "OdorPlume",
    "WindField",
    "WindParameters",
    "concentration",
    "sharan_concentration",
    "steady_concentration",
    "wind_velocity",
]
