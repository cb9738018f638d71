"""Leaf seal with unilateral contact: Tamatam 2021, chapter 6."""
