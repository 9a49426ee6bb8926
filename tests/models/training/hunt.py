"""A recipe for hunting that takes three updates."""

RECIPE = """
name = "predator_prey/small"
task = "predator_prey/5x5"
seed = 3

[model]
hidden = 12
message = 6
tokens = 5
channel = "prototype"
gate = "learned"

[decoder]
target = "location"
reads = "inbox"

[check]
every = 1
episodes = 10

[[phase]]
name = "imitate"
kind = "imitate"
updates = 1
episodes = 4
window = 7
rule_share = 0.5
discrete = false
decoder_weight = 1.0

[[phase]]
name = "listen"
updates = 1
episodes = 4
discrete = false
decoder_weight = 1.0

[[phase]]
name = "enforce"
updates = 1
episodes = 4
gate = "enforced"
budget = 0.5
shared = 0.5
decoder_weight = 1.0
"""
