!> Data to check before a run, in addition to the output of `run`: wave speeds, the energy of a
!> crack for each material, how many points each group of the scene acts on, and how long the
!> horizon is beside bodies and cracks.
module pd_output_report_overview
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_base_text, only: counted, line => labelled_line, to_text, with_unit
  use pd_scene_content_types, only: has_refinement, is_set, scene_type
  use pd_law_law, only: bond_law_type
  use pd_law_material, only: material_type, never
  use pd_body_body, only: body_type
  use pd_body_lattices, only: coordinate
  use pd_body_refine, only: level_of
  use pd_body_waves, only: longitudinal_speed, rayleigh_speed, shear_speed
  use pd_family_cracks, only: extents_of
  use pd_body_regions, only: region_mask
  use pd_set_up_conditions, only: no_fail_mask
  use pd_motion_loads, only: load_of, load_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: overview

contains

  !> The lines of the overview, each ended by a newline.
  function overview(scene, system, density_counts) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    logical, intent(in) :: density_counts   !! the scene's densities mean something
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(scene%materials)
      if (size(scene%materials) > 1) text = text//line('material', trim(scene%materials(i)%name))
      text = text//material_lines(scene, system%model%materials(i), &
        & system%model%laws(i)%law, density_counts)
    end do
    text = text//lengths(scene, system)//counts(scene, system)
  end function overview

  !> Wave speeds and critical stretch of a material.
  function material_lines(scene, m, law, density_counts) result(text)
    type(scene_type), intent(in) :: scene
    type(material_type), intent(in) :: m
    class(bond_law_type), intent(in) :: law
    logical, intent(in) :: density_counts
    character(:), allocatable :: text

    text = ''
    if (density_counts) then
      select case (scene%header%dimension)
      case (1)
        text = line('bar wave', with_unit(longitudinal_speed(m), 'm/s', 4))
      case (2)
        text = line('P wave', with_unit(longitudinal_speed(m), 'm/s', 4)//', plane '// &
          & trim(scene%header%plane))
      case (3)
        text = line('P wave', with_unit(longitudinal_speed(m), 'm/s', 4))
      case default
        call internal_fault('material_lines knows one to three dimensions')
      end select
      if (scene%header%dimension > 1) text = text// &
        & line('S wave', with_unit(shear_speed(m), 'm/s', 4))// &
        & line('Rayleigh wave', with_unit(rayleigh_speed(m), 'm/s', 4))
    end if
    if (m%critical_stretch >= never) return
    text = text//line('crit. stretch', to_text(m%critical_stretch, 4))
    if (m%toughness > 0.0_wp) then
      text = text//line('Gc', with_unit(energy_of(m%critical_stretch*sqrt(m%toughness), law), &
        & 'J/m2', 4)//', at which a crack grows through the lattice')// &
        & line('', 'with the critical stretch of the formula, '// &
        & to_text(m%critical_stretch*sqrt(m%toughness), 4)//', it would need')// &
        & line('', to_text(m%toughness, 4)//' Gc at most and '//to_text(m%mean_toughness, 4)// &
        & ' on average'//diagonal_text(m))
    else
      text = text//line('Gc', with_unit(energy_of(m%critical_stretch, law), 'J/m2', 4)// &
        & ', from the critical stretch at this horizon')
    end if
    if (m%scatter > 0.0_wp) text = text//line('scatter', 'Weibull modulus '// &
      & to_text(m%scatter, 4)//', seed '//to_text(m%seed)//', about the mean critical stretch')
  end function material_lines

  !> The toughness along diagonals of cells, where it is known.
  pure function diagonal_text(m) result(text)
    type(material_type), intent(in) :: m
    character(:), allocatable :: text
    text = ''
    if (m%diagonal_toughness > 0.0_wp) text = ', at 45 degrees '// &
      & to_text(m%diagonal_toughness, 4)//' Gc'
  end function diagonal_text

  !> The critical energy release rate of a critical stretch, which grows with a power of it; 0 for a
  !> law without one [J/m2].
  pure real(wp) function energy_of(s_c, law) result(Gc)
    real(wp), intent(in) :: s_c
    class(bond_law_type), intent(in) :: law
    real(wp) :: one, four

    Gc = 0.0_wp
    one = law%critical_stretch(1.0_wp)
    four = law%critical_stretch(4.0_wp)
    if (one > 0.0_wp) Gc = (s_c/one)**(log(4.0_wp)/log(four/one))
  end function energy_of

  !> The horizon compared with spacings, bodies and cracks.
  function lengths(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text
    real(wp), allocatable :: extents(:), along(:)
    logical, allocatable :: mine(:)
    real(wp) :: edges(3), delta
    integer :: i, c, g

    associate (body => system%body, rule => system%family%rule)
      text = ''
      do i = 1, size(scene%bodies)
        mine = body%body == i .and. body%layer == 0 .and. body%point > 0
        if (.not. any(mine)) cycle
        g = body%grid(findloc(mine, .true., dim=1))
        do c = 1, body%dim
          if (g > 0) then
            along = coordinate(body%grids(g), body%x, c)  ! of a turned body its own edges
          else
            along = body%x(:, c)
          end if
          edges(c) = maxval(along + body%spacing/2, mask=mine) &
            & - minval(along - body%spacing/2, mask=mine)
        end do
        delta = rule%delta
        if (rule%ratio > 0.0_wp) delta = rule%ratio*maxval(body%spacing, mask=mine)
        text = text//line('body '//to_text(i), with_unit(minval(edges(:body%dim)), 'm', 4)// &
          & ' in its thinnest direction: '//to_text(minval(edges(:body%dim))/delta, 3)// &
          & trim(merge(' of its largest horizons', ' horizons               ', &
          & rule%ratio > 0.0_wp)))
        if (rule%ratio > 0.0_wp) text = text//line('', 'horizons of '//with_unit(rule%ratio* &
          & minval(body%spacing, mask=mine), 'm', 4)//' to '//with_unit(delta, 'm', 4))
        if (g > 0 .and. has_refinement(scene)) text = text//line('', 'points of its levels: '// &
          & levels(body, mine))
      end do
      do i = 1, size(scene%cracks)
        if (scene%cracks(i)%surface /= '') cycle
        extents = extents_of(scene%cracks(i), body%dim)
        text = text//line('crack '//to_text(i), with_unit(minval(extents), 'm', 4)// &
          & trim(merge(' long                    ', ' in its shorter direction', &
          & size(extents) == 1))//': '// &
          & to_text(minval(extents)/rule%delta, 3)//trim(merge(' of the largest horizons', &
          & ' horizons               ', rule%ratio > 0.0_wp)))
      end do
    end associate
  end function lengths

  !> The numbers of points of the levels of a refined body, from level 0 on.
  function levels(body, mine) result(text)
    type(body_type), intent(in) :: body
    logical, intent(in) :: mine(:)  !! slots of its points
    character(:), allocatable :: text
    integer, allocatable :: level(:)
    integer :: k, n

    level = [(merge(level_of(body, k), -1, mine(k)), k=1, body%n_slots)]
    text = ''
    do n = 0, maxval(level)
      if (n > 0) text = text//', '
      text = text//to_text(count(level == n))
    end do
  end function levels

  !> Points of each region, boundary, load, line and no-fail zone.
  function counts(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in), target :: system
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(scene%regions)
      text = text//line('region '//to_text(i), trim(scene%regions(i)%name)//': '// &
        & counted(count(region_mask(scene, system%body, scene%regions(i)%name)), 'point'))
    end do
    do i = 1, size(system%motions)
      associate (group => scene%boundaries(i))
        text = text//line('boundary '//to_text(i), named(group%name)//counted(size( &
          & system%motions(i)%slots), 'point')//', '//place(group%side, group%region))
      end associate
    end do
    if (any(is_set(scene%header%gravity))) text = text//line('gravity', to_text(norm2( &
      & scene%header%gravity(:system%body%dim)), 4)//' m/s2 on '// &
      & counted(system%body%n_points, 'point'))
    do i = 1, size(scene%loads)
      associate (group => scene%loads(i))
        text = text//line('load '//to_text(i), counted(points_of_load(i), &
          & 'point')//', '//place(group%side, group%region))
      end associate
    end do
    do i = 1, size(scene%lines)
      text = text//line('line '//to_text(i), trim(scene%lines(i)%name)//': '// &
        & counted(scene%lines(i)%points, 'position'))
    end do
    do i = 1, size(scene%no_fail)
      text = text//line('no-fail zone '//to_text(i), &
        & counted(count(no_fail_mask(scene, system%body, i)), 'point'))
    end do

  contains

    !> On how many points the `l`-th load acts.
    integer function points_of_load(l) result(points)
      integer, intent(in) :: l
      type(load_type), pointer :: load
      load => load_of(system%terms, l)
      points = size(load%slots)
    end function points_of_load
  end function counts

  !> A name in front of its data.
  pure function named(name) result(text)
    character(*), intent(in) :: name
    character(:), allocatable :: text
    text = ''
    if (name /= '') text = trim(name)//': '
  end function named

  !> Where a boundary or a load acts.
  pure function place(side, region) result(text)
    character(*), intent(in) :: side, region
    character(:), allocatable :: text
    text = 'everywhere'
    if (region /= '') text = "region '"//trim(region)//"'"
    if (side /= '') text = 'side '//trim(side)
  end function place

end module pd_output_report_overview
