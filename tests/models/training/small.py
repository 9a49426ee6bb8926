"""A recipe that trains through every kind of phase in seconds."""

RECIPE = """
name = "traffic_junction/small"
task = "traffic_junction/easy"
seed = 3

[model]
hidden = 12
message = 6
tokens = 5
channel = "prototype"
gate = "learned"

[start]
arrival = [0.1, 0.3]

[decoder]
target = "occupancy"

[check]
every = 2
episodes = 10

[[phase]]
name = "listen"
kind = "imitate"
updates = 3
episodes = 4
window = 7
discrete = false
rule_share = 0.5
decoder_weight = 0.1

[[phase]]
name = "quantise"
kind = "imitate"
updates = 4
episodes = 4
window = 10
revive_every = 2
gate = "budget"
budget = 0.5
sampled = false

[[phase]]
name = "talk"
updates = 4
episodes = 4
gate = "rewarded"
leave = { success = 0.0, checks = 1 }

[[phase]]
name = "enforce"
updates = 4
episodes = 4
gate = "enforced"
budget = 0.5
entropy = 0.1
entropy_end = 0.01
explore = 0.05
first_collision_only = true
shared = 0.5
imitation_weight = 0.1
"""
