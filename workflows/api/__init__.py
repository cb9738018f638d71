"""What `import tribodyn` offers: scenes and their results, and the nouns to work with one's own matrices."""
