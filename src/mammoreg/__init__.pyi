from mammoreg.breast.mechanics import BreastMechanics as BreastMechanics
from mammoreg.errors import DataError as DataError
from mammoreg.errors import NotConvergedError as NotConvergedError
from mammoreg.geometry import Volume as Volume
from mammoreg.geometry import volume_of_affine as volume_of_affine
from mammoreg.imaging.acquisition import Mammogram as Mammogram
from mammoreg.pose.search import PoseSearch as PoseSearch
from mammoreg.registration import Breast as Breast
from mammoreg.registration import Located as Located
from mammoreg.registration import RegisteredView as RegisteredView
from mammoreg.registration import locate as locate
from mammoreg.registration import register as register

__version__: str
