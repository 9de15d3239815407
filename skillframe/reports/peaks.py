"""The three peaks of a contact force, in the words that every page, table and command uses for them.

| column | what it is | held to |
|---|---|---|
| `peak_force_n` | largest force of one control tick in the simulator | twice the limit |
| `peak_force_10ms_n` | largest mean over 10 ms of the simulator's force | the limit |
| `peak_force_filtered_n` | largest force that the controller's filtered estimate read | the limit |
"""

TICK = "peak contact force in the simulator, one tick"
MEAN = "contact force in the simulator, mean over 10 ms"
ESTIMATE = "contact force by the controller's estimate"
SHORT = {
    "peak_force_n": "one tick in the simulator", "peak_force_10ms_n": "mean over 10 ms in the simulator",
    "peak_force_filtered_n": "by the controller's estimate",
}  # fmt: skip
"""After "peak force", by column."""
