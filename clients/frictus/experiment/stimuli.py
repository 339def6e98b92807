"""Stimuli: what a level means on the screen, and what it was after the rig had its say."""

import math
from typing import Annotated, Final, Literal

from pydantic import Field, FiniteFloat, model_validator

from frictus.lenient import Exact
from frictus.textures import Region, Scene, Texture

MAX_GAIN: Final = 100.0
"""Of a region."""
MAX_DB: Final = 40.0
"""`MAX_GAIN` as 20 log10."""


class Amplitude(Exact):
    """A texture times the level, against a standard or a smooth screen.

    Write the texture with an amplitude of 1 N, and levels are newtons.
    """

    kind: Literal["amplitude"] = "amplitude"
    texture: Texture
    standard: Texture | None = None
    """The reference, as it is written; None is a smooth screen."""
    unit: Literal["N"] = "N"

    @property
    def max_level(self) -> float:
        """Greatest level that a scene can hold."""
        return MAX_GAIN

    def test(self, level: float) -> Scene:
        """Return the texture times the level.

        Parameters
        ----------
        level : float
            0 to 100.
        """
        return _scene(self.texture, level)

    def reference(self, level: float) -> Scene:
        """Return the standard, or a smooth screen.

        Parameters
        ----------
        level : float
            Is not used.
        """
        return Scene() if self.standard is None else _scene(self.standard, 1.0)

    def rendered(self, level: float, test_gain: float, reference_gain: float) -> float:
        """Return the amplitude that was rendered.

        Parameters
        ----------
        level : float
            As asked for.
        test_gain, reference_gain : float
            Of the two scenes.
        """
        return level * test_gain


class Difference(Exact):
    """A texture amplified by the level in dB, against the texture as it is written."""

    kind: Literal["difference"] = "difference"
    texture: Texture
    unit: Literal["dB"] = "dB"

    @property
    def max_level(self) -> float:
        """Greatest level that a scene can hold, dB."""
        return MAX_DB

    def test(self, level: float) -> Scene:
        """Return the amplified texture.

        Parameters
        ----------
        level : float
            dB, at most 40.
        """
        return _scene(self.texture, 10.0 ** (level / 20.0))

    def reference(self, level: float) -> Scene:
        """Return the texture as it is written.

        Parameters
        ----------
        level : float
            Is not used.
        """
        return _scene(self.texture, 1.0)

    def rendered(self, level: float, test_gain: float, reference_gain: float) -> float:
        """Return the difference that was rendered, dB; it may vanish or change its sign.

        Parameters
        ----------
        level : float
            As asked for.
        test_gain, reference_gain : float
            Of the two scenes.
        """
        if test_gain <= 0.0 or reference_gain <= 0.0:
            return -math.inf
        return level + 20.0 * math.log10(test_gain / reference_gain)


class NamedTexture(Exact):
    """A texture of a set that is compared."""

    name: Annotated[str, Field(min_length=1, max_length=50)]
    texture: Texture
    gain: Annotated[FiniteFloat, Field(gt=0.0, le=MAX_GAIN)] = 1.0


class Pairs(Exact):
    """All pairs of a set of textures; the level is the number of a pair, from 1."""

    kind: Literal["pairs"] = "pairs"
    textures: Annotated[list[NamedTexture], Field(min_length=2, max_length=20)]
    identical: bool = True
    """Whether each texture is also paired with itself."""
    unit: Literal["pair"] = "pair"

    @model_validator(mode="after")
    def _names_differ(self) -> "Pairs":
        names = [each.name for each in self.textures]
        if len(set(names)) < len(names):
            raise ValueError(f"textures bear different names, not {', '.join(names)}")
        return self

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Indices of the textures of each pair, in the order of the levels."""
        count, offset = len(self.textures), 0 if self.identical else 1
        return [(i, j) for i in range(count) for j in range(i + offset, count)]

    @property
    def max_level(self) -> float:
        """Number of the last pair."""
        return float(len(self.pairs))

    def names(self, level: float) -> tuple[str, str]:
        """Return the names of the textures of a pair.

        Parameters
        ----------
        level : float
            Number of the pair, from 1.
        """
        first, second = self.pairs[round(level) - 1]
        return self.textures[first].name, self.textures[second].name

    def test(self, level: float) -> Scene:
        """Return the first texture of a pair.

        Parameters
        ----------
        level : float
            Number of the pair, from 1.
        """
        chosen = self.textures[self.pairs[round(level) - 1][0]]
        return _scene(chosen.texture, chosen.gain)

    def reference(self, level: float) -> Scene:
        """Return the second texture of a pair.

        Parameters
        ----------
        level : float
            Number of the pair, from 1.
        """
        chosen = self.textures[self.pairs[round(level) - 1][1]]
        return _scene(chosen.texture, chosen.gain)

    def rendered(self, level: float, test_gain: float, reference_gain: float) -> float:
        """Return the number of the pair, which no gain changes.

        Parameters
        ----------
        level : float
            Number of the pair.
        test_gain, reference_gain : float
            Of the two scenes; they stand in the trial's row.
        """
        return level


Stimulus = Annotated[Amplitude | Difference | Pairs, Field(discriminator="kind")]


def _scene(texture: Texture, gain: float) -> Scene:
    return Scene(regions=[Region(texture=texture, gain=gain)])


def scaled(scene: Scene, gain: float) -> Scene:
    """Return a scene with the gain of every region multiplied.

    Parameters
    ----------
    scene : Scene
        Any scene.
    gain : float
        0 to 1.
    """
    regions = [each.model_copy(update={"gain": gain * each.gain}) for each in scene.regions]
    return scene.model_copy(update={"regions": regions})
