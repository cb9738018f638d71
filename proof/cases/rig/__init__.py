"""Fretting rig with prescribed platform height: Tamatam 2021, chapter 5."""
