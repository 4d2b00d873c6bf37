"""Pictures of runs, workspaces, designs and algebra."""
