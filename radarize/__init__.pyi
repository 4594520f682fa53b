from radarize.api.evaluation import Evaluation as Evaluation
from radarize.api.evaluation import evaluate as evaluate
from radarize.api.learning import torch_dataset as torch_dataset
from radarize.api.live import live as live
from radarize.api.load import load as load
from radarize.api.maps import doppler_azimuth as doppler_azimuth
from radarize.api.maps import range_azimuth as range_azimuth
from radarize.api.maps import range_doppler as range_doppler
from radarize.api.maps import range_profile as range_profile
from radarize.api.odometry import estimate_odometry as estimate_odometry
from radarize.api.plot import plot as plot
from radarize.api.points import PointCloud as PointCloud
from radarize.api.points import point_cloud as point_cloud
from radarize.api.run import Run as Run
from radarize.api.run import run as run
from radarize.errors import InputError as InputError
from radarize.recording import Recording as Recording
from radarize.trajectory import Trajectory as Trajectory

__version__: str
odometry = estimate_odometry
