"""Whether a simulated rig measured a model; of earlier ones nobody said."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add the column; what is published stays as it is."""
    op.add_column(
        "models",
        sa.Column("simulated", sa.Boolean(), nullable=False, server_default=sa.false()),
    )
