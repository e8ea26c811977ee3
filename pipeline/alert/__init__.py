"""Alert rules: a situation in, the conflicts in it out.

A rule is a part: a frozen dataclass with `PART` naming it, settings as fields (`RuleSettings` holds those that all
have: times of both stages by visibility, and changes for single runways), and

    __call__(self, situation: Situation) -> tuple[Conflict, ...]

It keeps nothing between calls: what needs memory (passed holding positions, who has landed) is in the situation, and
the life of an alert (raising after k of n, escalating, clearing, acknowledging) is led by
`pipeline.alert.monitor`.
A rule names each pair once, the moving target first, says which of them is the intruder, and "certain" when one look is
enough. What all rules say about one intruder on one runway is one alert (`pipeline.alert.merge`). Rows that are not
`usable` and pairs that are `together` (tow, escort, one target seen twice) are never reported.

Figures without a readable source (30/15 s to threshold, 45/30 s in low visibility) are engineering values, set in the
settings file, by runway where wanted.
"""
