"""The number that says whether an edit helped: how far what was measured is from what the model shows now.

Of a blooming table it is the `misfit` of the target's profile, of everything else the `gap` that `explain` prints, on
columns spread over the frame. Both are in standard deviations of one beam, and are never set side by side.
"""
