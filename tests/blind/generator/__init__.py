"""Studies with something hidden in them, as raw samples.

The physics is written anew from the paper and the equations of the effects; of the product only
the writer of study files is used, so that what looks for the hidden cannot know how it was hid.
"""

from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.study import Seeds, make_study

__all__ = ["Case", "Design", "Hidden", "Seeds", "make_study"]
