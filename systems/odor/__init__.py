"""Wind, odour plume, and the sensors that feel them."""

from systems.odor.airflow_sensors import AirflowParameters, AirflowSensors
from systems.odor.gas_sensor_array import GasSensorArray, GasSensorParameters
from systems.odor.odor_plume import OdorParameters, OdorPlume, concentration
from systems.odor.steady_plume import sharan_concentration, steady_concentration
from systems.odor.wind import WindField, WindParameters, wind_velocity

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
