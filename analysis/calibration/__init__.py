"""Arrays that sounds calibrate: places of microphones and the speed of sound."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.calibration.calibrate import (
        CalibrationRun,
        calibrate,
        calibration_run,
    )
    from analysis.calibration.calibration import Calibration, calibrate_array
    from analysis.calibration.calibration_misfit import calibration_misfit
    from analysis.calibration.calibration_sounds import (
        CalibrationSounds,
        load_calibration_sounds,
    )
    from analysis.calibration.calibration_text import calibration_text
    from analysis.calibration.measured_sound import MeasuredSound
    from analysis.calibration.observability import calibration_gains, gain_ratios
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "Calibration",
    "CalibrationRun",
    "CalibrationSounds",
    "MeasuredSound",
    "calibrate",
    "calibrate_array",
    "calibration_gains",
    "calibration_misfit",
    "calibration_run",
    "calibration_text",
    "gain_ratios",
    "load_calibration_sounds",
]
