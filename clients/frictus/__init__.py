"""Feel textures on a friction-modulated touchscreen, from anywhere on the network.

>>> import frictus
>>> with frictus.connect("tcp/127.0.0.1:7447") as client:
...     rig = client.rig("sim")
...     with rig.arm():
...         rig.set_scene(frictus.load_texture("linen.wav", speed_mm_s=40.0))
...         for finger in rig.fingers():
...             print(finger.x_mm, finger.vx_mm_s)
"""

from frictus.aligned import AlignedSamples, align
from frictus.block import Block, FingerSensor, Flag
from frictus.client import Client, Presence, RigName, connect
from frictus.errors import (
    ArgumentError,
    CertificateError,
    FrameError,
    FrictusError,
    LeaseLostError,
    LinkError,
    NoRigError,
    NotLoggedError,
    OutcomeUnknownError,
    OutdatedStateError,
    RefusedError,
    SilenceError,
    TextureError,
)
from frictus.gaps import BlockFeed, Gap
from frictus.keys import InvalidNameError, Topic, Topics
from frictus.lease import Lease
from frictus.messages import (
    Applied,
    Excitation,
    Fault,
    FingerState,
    GuidanceState,
    ModelState,
    RigStatus,
    SceneState,
    TimeState,
    Tone,
    TouchState,
)
from frictus.model import Compensation, Model
from frictus.reception import Feed
from frictus.recordings import load_texture
from frictus.rig import Rig
from frictus.session import DEFAULT_ROUTER
from frictus.stream import TextureStream
from frictus.textures import (
    Beta,
    Component,
    Map,
    Profile,
    Region,
    Scene,
    Slope,
    Spectrum,
    Texture,
)
from frictus.tls import Tls

__all__ = [
    "DEFAULT_ROUTER",
    "AlignedSamples",
    "Applied",
    "ArgumentError",
    "Beta",
    "Block",
    "BlockFeed",
    "CertificateError",
    "Client",
    "Compensation",
    "Component",
    "Excitation",
    "Fault",
    "Feed",
    "FingerSensor",
    "FingerState",
    "Flag",
    "FrameError",
    "FrictusError",
    "Gap",
    "GuidanceState",
    "InvalidNameError",
    "Lease",
    "LeaseLostError",
    "LinkError",
    "Map",
    "Model",
    "ModelState",
    "NoRigError",
    "NotLoggedError",
    "OutcomeUnknownError",
    "OutdatedStateError",
    "Presence",
    "Profile",
    "RefusedError",
    "Region",
    "Rig",
    "RigName",
    "RigStatus",
    "Scene",
    "SceneState",
    "SilenceError",
    "Slope",
    "Spectrum",
    "Texture",
    "TextureError",
    "TextureStream",
    "TimeState",
    "Tls",
    "Tone",
    "Topic",
    "Topics",
    "TouchState",
    "align",
    "connect",
    "load_texture",
]
