"""The gravest stage that an alert had, and who acknowledged it last, as columns of their own.

`stage` is the last one: an alarm that had been lowered before it ended was found as information. Of alerts stored
before, both are taken from their stored steps.
"""

from __future__ import annotations

import json

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

WORST = """
UPDATE alerts SET worst_stage = 'alarm' WHERE stage = 'alarm' OR EXISTS (
    SELECT 1 FROM alert_changes
    WHERE alert_changes.airport = alerts.airport AND alert_changes.alert_id = alerts.id
    AND alert_changes.stage = 'alarm'
)
"""
NAMED = "UPDATE alerts SET acknowledged_by = :name WHERE airport = :airport AND id = :id"
STEPS = "SELECT airport, alert_id, document FROM alert_changes WHERE operation = 'acknowledge' ORDER BY change_id"


def upgrade() -> None:
    op.add_column("alerts", sa.Column("worst_stage", sa.String(16), nullable=False, server_default="information"))
    op.add_column("alerts", sa.Column("acknowledged_by", sa.String(64)))
    connection = op.get_bind()
    connection.execute(sa.text(WORST))
    names = {}
    for airport, alert, document in connection.execute(sa.text(STEPS)):
        name = json.loads(document).get("acknowledged_by")
        if name:
            names[airport, alert] = name[:64]
    for (airport, alert), name in names.items():
        connection.execute(sa.text(NAMED), {"airport": airport, "id": alert, "name": name})


def downgrade() -> None:
    op.drop_column("alerts", "acknowledged_by")
    op.drop_column("alerts", "worst_stage")
