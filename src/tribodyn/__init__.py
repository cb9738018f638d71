"""From geometry to worn surface: vibration, friction and fretting wear of jointed parts."""
